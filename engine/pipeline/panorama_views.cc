#include "engine/pipeline/panorama_views.h"

#include <algorithm>
#include <filesystem>
#include <map>
#include <utility>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "engine/core/parallel.h"
#include "engine/io/file_util.h"
#include "engine/io/image_io.h"
#include "engine/io/mask_io.h"
#include "engine/io/panorama.h"

namespace litags {
namespace {

namespace fs = std::filesystem;

std::string FieldOf(const std::string& name) { return absl::StrCat("images[", name, "]"); }

std::string PathOf(const ReconstructInput& input, const std::string& name) {
  return absl::StrCat(input.images_dir, "/", name);
}

// A photo that is twice as wide as high.
struct Candidate {
  std::string name;
  int width = 0;                      // px
  bool says = false, closed = false;  // as its metadata and its edges tell
};

void Look(const ReconstructInput& input, Candidate* candidate) {
  const std::string field = FieldOf(candidate->name);
  const auto bytes = ReadFile(PathOf(input, candidate->name), field, ImageLimits().max_bytes);
  if (!bytes.ok()) return;
  candidate->says = SaysPanorama(*bytes);
  if (candidate->says) return;
  const auto photo = DecodePhoto(*bytes, field);
  candidate->closed = photo.ok() && IsClosedAround(*photo);
}

// Names of the panoramas, in order. Edges say less than metadata: of ordinary photos cut to this
// shape, 2 % seem closed, 13 % in one dark capture. So they count where three and three quarters of
// the photos of a size are closed, and then for all of these.
absl::StatusOr<std::vector<std::string>> FindPanoramas(const ReconstructInput& input,
                                                       const std::vector<std::string>& names,
                                                       int threads, const CancelToken& cancel) {
  constexpr int kLeastClosed = 3;
  constexpr double kShareClosed = 0.75;
  std::vector<Candidate> candidates;
  for (const std::string& name : names) {
    const auto size = ReadImageSize(PathOf(input, name), FieldOf(name));
    if (size.ok() && size->width == 2 * size->height) candidates.push_back({name, size->width});
  }
  ParallelFor(threads, candidates.size(), [&](size_t i, int) {
    if (!cancel.IsCancelled()) Look(input, &candidates[i]);
  });
  LITAGS_RETURN_IF_ERROR(cancel.Check());
  std::map<int, std::pair<int, int>> closed_of;  // by width
  for (const Candidate& candidate : candidates) {
    closed_of[candidate.width].first += candidate.closed || candidate.says;
    ++closed_of[candidate.width].second;
  }
  std::vector<std::string> panoramas;
  for (const Candidate& candidate : candidates) {
    const auto& [closed, all] = closed_of[candidate.width];
    const bool like_others = closed >= kLeastClosed && closed >= kShareClosed * all;
    if (candidate.says || like_others) panoramas.push_back(candidate.name);
  }
  return panoramas;
}

absl::Status MakeEmptyFolder(const fs::path& dir) {
  std::error_code error;
  fs::remove_all(dir, error);
  fs::create_directories(dir, error);
  if (!error) return absl::OkStatus();
  return MakeError(absl::StatusCode::kFailedPrecondition, "FOLDER_NOT_WRITABLE", "work_dir",
                   absl::StrCat("cannot make ", dir.string(), ": ", error.message()));
}

absl::Status Link(const fs::path& target, const fs::path& link) {
  std::error_code error;
  fs::create_symlink(fs::absolute(target), link, error);
  if (!error) return absl::OkStatus();
  return MakeError(absl::StatusCode::kFailedPrecondition, "FOLDER_NOT_WRITABLE", "work_dir",
                   absl::StrCat("cannot write ", link.string(), ": ", error.message()));
}

std::string NameOfView(const std::string& base, const PanoramaView& view) {
  return absl::StrCat(base, "_", view.name, ".png");
}

// What the names of a panorama's views begin with: its own without the ending, or all of it where
// another photo differs in the ending only.
std::string BaseOf(const std::string& panorama, const std::vector<std::string>& names) {
  const std::string stem = Stem(panorama);
  const auto alike =
      std::count_if(names.begin(), names.end(), [&](const auto& n) { return Stem(n) == stem; });
  return alike > 1 ? panorama : stem;
}

// One file for each view, all at once.
absl::Status WriteViews(
    const fs::path& dir, const std::string& base, int threads,
    const std::function<absl::StatusOr<std::string>(const PanoramaView&)>& png) {
  std::vector<absl::Status> statuses(kPanoramaViews.size());
  ParallelFor(threads, kPanoramaViews.size(), [&](size_t i, int) {
    const PanoramaView& view = kPanoramaViews[i];
    const auto bytes = png(view);
    statuses[i] =
        bytes.ok() ? WriteFileAtomically(dir / NameOfView(base, view), *bytes) : bytes.status();
  });
  for (absl::Status& status : statuses) LITAGS_RETURN_IF_ERROR(std::move(status));
  return absl::OkStatus();
}

// `width`: of the panorama, px.
absl::Status WriteMaskViews(const fs::path& dir, const std::string& base,
                            const std::string& mask_path, int width, int threads) {
  const std::string field = absl::StrCat("masks[", BaseName(mask_path), "]");
  LITAGS_ASSIGN_OR_RETURN(const std::string bytes,
                          ReadFile(mask_path, field, ImageLimits().max_bytes));
  LITAGS_ASSIGN_OR_RETURN(const PlaneU8 mask, DecodeMask(bytes, field));
  LITAGS_RETURN_IF_ERROR(
      CheckMaskSize(BaseName(mask_path), mask.width, mask.height, width, width / 2));
  return WriteViews(dir, base, threads, [&](const PanoramaView& view) {
    return EncodeMask(CutPanoramaView(mask, view));
  });
}

// The panorama's width, px.
absl::StatusOr<int> CutPanorama(const ReconstructInput& input, const std::string& name,
                                const std::string& base, const fs::path& dir, int threads,
                                RigViews* rig_views) {
  LITAGS_ASSIGN_OR_RETURN(const Photo panorama, ReadPhoto(PathOf(input, name), FieldOf(name)));
  LITAGS_RETURN_IF_ERROR(WriteViews(dir, base, threads, [&](const PanoramaView& view) {
    return EncodePng16(CutPanoramaView(panorama, view));
  }));
  const double focal_length = PanoramaViewSide(panorama.width) / 2.0;
  for (const PanoramaView& view : kPanoramaViews) {
    (*rig_views)[NameOfView(base, view)] = {name, view.R, focal_length};
  }
  return panorama.width;
}

}  // namespace

absl::StatusOr<ReconstructInput> WithViewsOfPanoramas(
    const ReconstructInput& input, int threads, const CancelToken& cancel,
    const std::function<void(const std::string&)>& progress, std::vector<std::string>* notes) {
  if (!input.cameras_path.empty()) return input;
  const auto names = ListPhotos(input.images_dir, "images");
  if (!names.ok()) return input;  // the screen of photos says why
  LITAGS_ASSIGN_OR_RETURN(const std::vector<std::string> panoramas,
                          FindPanoramas(input, *names, threads, cancel));
  if (panoramas.empty()) return input;
  ReconstructInput result = input;
  const fs::path views = fs::path(input.work_dir) / "panorama_views", masks = views / "masks";
  LITAGS_RETURN_IF_ERROR(MakeEmptyFolder(views));
  MaskPaths given;
  if (!input.masks_dir.empty()) {
    LITAGS_ASSIGN_OR_RETURN(given, FindMasks(input.masks_dir, *names));
    LITAGS_RETURN_IF_ERROR(MakeEmptyFolder(masks));
  }
  for (const std::string& name : *names) {
    LITAGS_RETURN_IF_ERROR(cancel.Check());
    const auto mask = given.find(name);
    if (std::binary_search(panoramas.begin(), panoramas.end(), name)) {
      progress(absl::StrCat("views of panoramas: ", name));
      const std::string base = BaseOf(name, *names);
      LITAGS_ASSIGN_OR_RETURN(const int width,
                              CutPanorama(input, name, base, views, threads, &result.rig_views));
      if (mask == given.end()) continue;
      LITAGS_RETURN_IF_ERROR(WriteMaskViews(masks, base, mask->second, width, threads));
    } else {
      LITAGS_RETURN_IF_ERROR(Link(PathOf(input, name), views / name));
      if (mask == given.end()) continue;
      LITAGS_RETURN_IF_ERROR(Link(mask->second, masks / absl::StrCat(name, ".png")));
    }
  }
  result.images_dir = views;
  if (!given.empty()) result.masks_dir = masks;
  notes->push_back(absl::StrCat(panoramas.size(),
                                " photos are panoramas of the whole sphere, such as ", panoramas[0],
                                ": six views of each are the photos"));
  return result;
}

}  // namespace litags
