#include "engine/pipeline/wide_views.h"

#include <algorithm>
#include <filesystem>
#include <map>
#include <set>
#include <utility>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "engine/core/parallel.h"
#include "engine/io/alpha_mask.h"
#include "engine/io/colmap_io.h"
#include "engine/io/file_util.h"
#include "engine/io/image_io.h"
#include "engine/io/mask_io.h"
#include "engine/io/work_folder.h"
#include "engine/pipeline/photo_place.h"
#include "engine/pipeline/photo_screen.h"
#include "engine/pipeline/turned_view.h"
#include "engine/pipeline/wide_photos.h"

namespace litags {
namespace {

namespace fs = std::filesystem;

// Of a view's pixels, that must count.
constexpr double kLeastLeft = 0.05;

// What the names of a photo's views begin with: its own without the ending, or all of it where
// another photo differs in the ending only, or is named as a view would be.
std::string BaseOf(const std::string& photo, const std::vector<std::string>& names) {
  const std::string base = Stem(photo);
  std::set<std::string> taken = {base};
  for (const CubeView& view : kCubeViews) taken.insert(absl::StrCat(base, "_", view.name));
  const auto alike = std::count_if(names.begin(), names.end(),
                                   [&](const auto& name) { return taken.contains(Stem(name)); });
  return alike > 1 ? photo : base;
}

// A wide photo's file.
struct Source {
  ImageInfo info;
  Photo photo;
  PlaneU8 alpha;
};

absl::StatusOr<Source> ReadSource(const ReconstructInput& input, const std::string& name) {
  const std::string field = PhotoField(name);
  LITAGS_ASSIGN_OR_RETURN(const std::string bytes,
                          ReadFile(PhotoPath(input, name), field, ImageLimits().max_bytes));
  Source source;
  LITAGS_ASSIGN_OR_RETURN(source.info, ReadImageInfo(bytes, field));
  LITAGS_ASSIGN_OR_RETURN(source.photo, DecodePhoto(bytes, field));
  source.alpha = AlphaMask(bytes, source.info.orientation);
  return source;
}

// What `other` hides, too; empty masks hide nothing.
void Hide(const PlaneU8& other, PlaneU8* mask) {
  if (mask->empty()) *mask = other;
  for (size_t i = 0; i < other.data.size(); ++i) mask->data[i] &= other.data[i];
}

// Where the views and their masks go, and what they are.
struct Output {
  fs::path dir, masks;
  RigViews rig_views;
  std::vector<ViewOfPhoto> views;     // if cameras are given
  std::vector<WidePhoto> cut;         // with the views that were made
  std::vector<std::string> left_out;  // notes
};

// Writes the views of one photo. Their names by that of the cube's view.
absl::StatusOr<std::map<std::string, std::string>> WriteViews(const Source& source,
                                                              const WidePhoto& wide,
                                                              const std::string& base,
                                                              const std::string& mask_path,
                                                              int threads, const Output& out) {
  PlaneU8 mask;
  if (!mask_path.empty()) {
    LITAGS_ASSIGN_OR_RETURN(mask, ReadMask(mask_path, wide.lens.width, wide.lens.height));
  }
  Hide(source.alpha, &mask);
  std::vector<absl::Status> statuses(wide.views.size());
  std::vector<std::string> names(wide.views.size());
  ParallelFor(threads, wide.views.size(), [&](size_t i, int) {
    statuses[i] = [&]() -> absl::Status {
      const CubeView& view = wide.views[i];
      const PlaneU8 shown = CutMask(mask, wide.lens, view);
      const auto all = static_cast<double>(shown.data.size());
      const auto hidden = static_cast<double>(std::count(shown.data.begin(), shown.data.end(), 0));
      if (all - hidden < kLeastLeft * all) return absl::OkStatus();
      names[i] = absl::StrCat(base, "_", view.name, ".png");
      LITAGS_ASSIGN_OR_RETURN(
          const std::string png,
          EncodePng16(CutView(source.photo, wide.lens, view), SignificantBits(source.info)));
      LITAGS_RETURN_IF_ERROR(WriteFileAtomically(out.dir / names[i], png));
      if (hidden == 0) return absl::OkStatus();
      LITAGS_ASSIGN_OR_RETURN(const std::string cut, EncodeMask(shown));
      return WriteFileAtomically(out.masks / names[i], cut);
    }();
  });
  for (absl::Status& status : statuses) LITAGS_RETURN_IF_ERROR(std::move(status));
  std::map<std::string, std::string> written;
  for (size_t i = 0; i < names.size(); ++i) {
    if (!names[i].empty()) written[wide.views[i].name] = names[i];
  }
  return written;
}

absl::Status CutPhoto(const Source& source, const WidePhotos& wide, const WidePhoto& photo,
                      const std::string& base, const std::string& mask_path, int threads,
                      Output* out) {
  LITAGS_ASSIGN_OR_RETURN(const auto written,
                          WriteViews(source, photo, base, mask_path, threads, *out));
  if (written.empty()) {
    out->left_out.push_back(absl::StrCat(photo.name, " is left out: its mask leaves less than ",
                                         100 * kLeastLeft, " % of every view of it"));
    return absl::OkStatus();
  }
  WidePhoto cut = photo;
  std::erase_if(cut.views, [&](const CubeView& view) { return !written.contains(view.name); });
  const ImageInfo& info = source.info;
  const int side = photo.lens.view_side;
  for (const CubeView& view : cut.views) {
    const std::string& name = written.at(view.name);
    out->rig_views[name] = {photo.name, view.R,        side / 2.0,      info.exposure_time,
                            info.iso,   info.f_number, info.chroma_step};
    if (photo.camera < 0) continue;
    const Camera& camera = wide.cameras.views[photo.camera].camera;
    out->views.push_back({{name, TurnedView(camera, view, side)}, photo.camera});
  }
  out->cut.push_back(std::move(cut));
  return absl::OkStatus();
}

// The photos that stay or cannot be read, the views in place of the others, and all masks.
absl::Status WriteAll(const ReconstructInput& input, const PhotoList& list, const WidePhotos& wide,
                      int threads, const CancelToken& cancel,
                      const std::function<void(const std::string&)>& progress, Output* out) {
  std::map<std::string, const WidePhoto*> by_name;
  for (const WidePhoto& photo : wide.photos) by_name[photo.name] = &photo;
  for (const std::string& name : list.names) {
    LITAGS_RETURN_IF_ERROR(cancel.Check());
    const auto mask = list.masks.find(name);
    const std::string mask_path = mask == list.masks.end() ? "" : mask->second;
    if (const auto cut = by_name.find(name); cut != by_name.end()) {
      progress(absl::StrCat("views of wide photos: ", name));
      if (const auto source = ReadSource(input, name); source.ok()) {
        LITAGS_RETURN_IF_ERROR(CutPhoto(*source, wide, *cut->second, BaseOf(name, list.names),
                                        mask_path, threads, out));
        continue;
      }
    }
    LITAGS_RETURN_IF_ERROR(LinkInWorkDir(PhotoPath(input, name), out->dir / name));
    if (mask_path.empty()) continue;
    LITAGS_RETURN_IF_ERROR(LinkInWorkDir(mask_path, out->masks / absl::StrCat(name, ".png")));
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<CutInput> WithViewsOfWidePhotos(
    const CutInput& input, int threads, const CancelToken& cancel,
    const std::function<void(const std::string&)>& progress, std::vector<std::string>* notes) {
  const auto list = ListPhotosAndMasks(input);
  if (!list.ok()) return input;  // the screen of photos says why
  LITAGS_ASSIGN_OR_RETURN(const WidePhotos wide,
                          FindWidePhotos(input, list->names, threads, cancel));
  if (wide.photos.empty()) return input;
  // Fisheyes that were solved among panoramas' views, which are read from the first folder.
  const bool again = !input.rig_views.empty();
  const fs::path dir = fs::path(input.work_dir) / (again ? "wide_views_2" : "wide_views");
  Output out;
  out.dir = dir;
  out.masks = dir / "masks";
  LITAGS_RETURN_IF_ERROR(MakeEmptyFolder(out.dir));
  LITAGS_RETURN_IF_ERROR(MakeFolder(out.masks));
  LITAGS_RETURN_IF_ERROR(WriteAll(input, *list, wide, threads, cancel, progress, &out));
  CutInput result = input;
  result.images_dir = out.dir;
  result.rig_views.merge(out.rig_views);
  std::error_code ignored;  // reading masks says what is wrong
  result.masks_dir = fs::is_empty(out.masks, ignored) ? "" : out.masks.string();
  if (!input.cameras_path.empty()) {
    const fs::path cameras = dir / "cameras";
    LITAGS_RETURN_IF_ERROR(MakeFolder(cameras));
    LITAGS_RETURN_IF_ERROR(WriteColmapModel(cameras, CamerasOfViews(wide, out.views)));
    result.cameras_path = cameras;
    result.cameras_are_upright = true;
  }
  for (const auto& lines : {list->notes, wide.notes, out.left_out, DescribeWidePhotos(out.cut)}) {
    notes->insert(notes->end(), lines.begin(), lines.end());
  }
  return result;
}

}  // namespace litags
