#include "engine/tools/inspect/inspect.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <map>
#include <set>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "engine/core/counted.h"
#include "engine/core/error.h"
#include "engine/core/limits.h"
#include "engine/core/machine_memory.h"
#include "engine/core/parallel.h"
#include "engine/io/cameras_io.h"
#include "engine/io/depth_io.h"
#include "engine/io/file_util.h"
#include "engine/io/image_io.h"
#include "engine/pipeline/depth_maps.h"
#include "engine/pipeline/given_cameras.h"
#include "engine/pipeline/memory_estimate.h"
#include "engine/pipeline/photo_screen.h"
#include "engine/pipeline/video_frames.h"
#include "engine/pipeline/wide_photos.h"
#include "engine/tools/inspect/folder_contents.h"
#include "engine/tools/inspect/photo_sheet.h"
#include "engine/video/video_file.h"

namespace litags {
namespace {

namespace fs = std::filesystem;

std::string Stops(double light, double middle) {
  if (!(light > 0) || !(middle > 0)) return "-";
  const double tenths = std::round(10 * std::log2(light / middle));
  return tenths == 0 ? "0.0" : absl::StrFormat("%+.1f", tenths / 10);  // never "-0.0"
}

// With blanks up to so many characters of UTF-8; StrFormat() counts bytes.
std::string Padded(std::string text, size_t characters) {
  const auto begins = [](char byte) { return (static_cast<unsigned char>(byte) & 0xC0) != 0x80; };
  const auto count = static_cast<size_t>(std::count_if(text.begin(), text.end(), begins));
  if (count < characters) text.append(characters - count, ' ');
  return text;
}

// "28 mm", or what the photo is and of how many views: "panorama: 6 views".
std::string Lens(const ImageInfo& info, const WidePhoto* wide) {
  if (wide != nullptr) return absl::StrCat(wide->kind, ": ", wide->views.size(), " views");
  return info.focal_length == 0 ? "-" : absl::StrFormat("%g mm", info.focal_length);
}

// "1/30 s f/1.8 ISO 800", of what EXIF says.
std::string Exposure(const ImageInfo& info) {
  std::string text;
  if (info.exposure_time >= 0.3) {
    text = absl::StrFormat("%.2g s", info.exposure_time);
  } else if (info.exposure_time > 0) {
    text = absl::StrFormat("1/%.0f s", 1 / info.exposure_time);
  }
  if (info.f_number > 0) absl::StrAppendFormat(&text, " f/%g", info.f_number);
  if (info.iso > 0) absl::StrAppendFormat(&text, " ISO %g", info.iso);
  return text.empty() ? "-" : text;
}

std::map<std::string, const WidePhoto*> ByName(const WidePhotos& wide) {
  std::map<std::string, const WidePhoto*> by_name;
  for (const WidePhoto& photo : wide.photos) by_name[photo.name] = &photo;
  return by_name;
}

// The photos that a run would train on.
std::vector<ScreenedPhoto> WithViews(const std::vector<ScreenedPhoto>& photos,
                                     const std::map<std::string, const WidePhoto*>& wide) {
  std::vector<ScreenedPhoto> views;
  for (const ScreenedPhoto& photo : photos) {
    const auto found = wide.find(photo.name);
    views.push_back(photo);
    if (found == wide.end()) continue;
    views.back().width = views.back().height = found->second->lens.view_side;
    const ScreenedPhoto view = views.back();
    views.insert(views.end(), found->second->views.size() - 1, view);
  }
  return views;
}

// As a run has it: where cameras are given, photos without one are left out.
PhotoScreen LeaveOutWithoutCamera(PhotoScreen screen, const std::set<std::string>& with_camera) {
  std::erase_if(screen.photos, [&](const ScreenedPhoto& photo) {
    if (with_camera.contains(photo.name)) return false;
    screen.left_out.push_back({photo.name, "has no camera"});
    return true;
  });
  return screen;
}

// "1 photo would be used, as 6 views, 2 are left out".
std::string DescribeCounts(const PhotoScreen& screen, size_t views) {
  const size_t photos = screen.photos.size(), left_out = screen.left_out.size();
  return absl::StrCat(Counted(photos, "photo"), " would be used",
                      views == photos ? "" : absl::StrCat(", as ", views, " views"), ", ", left_out,
                      left_out == 1 ? " is left out" : " are left out");
}

// Cameras that lie in the folder or beside it, and are not used unless they are named.
std::string CamerasNearby(const ReconstructInput& input) {
  const fs::path photos = fs::absolute(input.images_dir).lexically_normal();
  for (const fs::path& dir : {photos, photos.parent_path()}) {
    const std::string found = ResolveCameras(dir);
    if (found != dir.string()) return found;
  }
  return "";
}

// Reads the depth maps of the photos: "depth maps: 4 of 5 photos have one". Errors of CheckMapsFit
// and of maps.
absl::StatusOr<std::string> DescribeDepthMaps(const ReconstructInput& input,
                                              const std::vector<ScreenedPhoto>& photos,
                                              const CancelToken& cancel) {
  LITAGS_RETURN_IF_ERROR(CheckMapsFit(input));
  size_t maps = 0;
  for (const ScreenedPhoto& photo : photos) {
    LITAGS_RETURN_IF_ERROR(cancel.Check());
    const std::string path = FindDepthMap(input.depth_dir, Stem(photo.name));
    if (path.empty()) continue;
    LITAGS_RETURN_IF_ERROR(ReadDepthMap(path, absl::StrCat("depth/", BaseName(path))).status());
    ++maps;
  }
  return absl::StrCat("depth maps: ", maps, " of ", Counted(photos.size(), "photo"),
                      maps == 1 ? " has one\n" : " have one\n");
}

}  // namespace

absl::Status InspectFolder(const ReconstructInput& given, const ReconstructOptions& options,
                           const std::string& sheet, const CancelToken& cancel, std::string* text) {
  ReconstructInput input = given;
  const int threads = options.threads > 0 ? options.threads : DefaultThreadCount();
  if (!sheet.empty()) LITAGS_RETURN_IF_ERROR(CheckSheetPath(sheet));
  LITAGS_RETURN_IF_ERROR(CheckHoldsPhotos(input.images_dir));
  LITAGS_ASSIGN_OR_RETURN(const std::string others,
                          DescribeOtherPictures(input.images_dir, "images"));
  LITAGS_ASSIGN_OR_RETURN(PhotoScreen screen, ScreenPhotos(input, threads, cancel));
  LITAGS_ASSIGN_OR_RETURN(const WidePhotos wide,
                          FindWidePhotos(input, screen.Names(), threads, cancel));
  const std::map<std::string, const WidePhoto*> wide_by_name = ByName(wide);
  std::set<std::string> with_camera;
  if (!input.cameras_path.empty() && !screen.photos.empty()) {
    input.cameras_path = ResolveCameras(input.cameras_path);
    PanoramaNames panoramas;
    LITAGS_ASSIGN_OR_RETURN(const SparseModel model,
                            ReadGivenCameras(input, screen.Names(), &screen.notes, &panoramas));
    for (const View& view : model.views) with_camera.insert(view.name);
    for (const WidePhoto& photo : wide.photos) with_camera.insert(photo.name);
  }
  const PhotoScreen used =
      input.cameras_path.empty() ? screen : LeaveOutWithoutCamera(screen, with_camera);
  const std::vector<ScreenedPhoto> views = WithViews(used.photos, wide_by_name);
  std::string depth;
  if (!input.depth_dir.empty() && !used.photos.empty()) {
    depth = "depth maps: not looked at, since they are of the views\n";
    if (wide.photos.empty()) {
      LITAGS_ASSIGN_OR_RETURN(depth, DescribeDepthMaps(input, used.photos, cancel));
    }
  }
  const std::string thumbnails = sheet.empty() ? "" : input.work_dir + "/thumbnails";
  std::error_code ignored;  // writing the sheet says what is wrong
  if (!sheet.empty()) {
    fs::create_directories(thumbnails, ignored);
    WriteThumbnails(input, used, threads, thumbnails, cancel);
  }
  const double middle_sharpness = MiddleOf(screen.photos, &ScreenedPhoto::sharpness);
  LITAGS_RETURN_IF_ERROR(cancel.Check());
  constexpr size_t kNameWidth = 32;
  constexpr char kLine[] = "%s %-11s %-17s %-22s %6s %6s %6s  %-5s%s\n";
  *text = absl::StrFormat(kLine, Padded("photo", kNameWidth), "px", "lens", "exposure", "code",
                          "stops", "sharp", "mask", input.cameras_path.empty() ? "" : " camera");
  for (const ScreenedPhoto& photo : screen.photos) {
    const ImageInfo info =
        ReadImageSize(input.images_dir + "/" + photo.name, photo.name).value_or(ImageInfo());
    const auto found = wide_by_name.find(photo.name);
    absl::StrAppendFormat(
        text, kLine, Padded(photo.name, kNameWidth), absl::StrCat(photo.width, "x", photo.height),
        Lens(info, found == wide_by_name.end() ? nullptr : found->second), Exposure(info),
        absl::StrFormat("%.1f", photo.mean_code), Stops(photo.light, screen.middle_light),
        absl::StrFormat("%.2f", middle_sharpness > 0 ? photo.sharpness / middle_sharpness : 0),
        screen.masks.contains(photo.name) ? "yes" : "-",
        input.cameras_path.empty()         ? ""
        : with_camera.contains(photo.name) ? " yes"
                                           : " none: left out");
  }
  absl::StrAppend(text,
                  "code: mean pixel value of 255; stops: light beside the middle photo, +1 is "
                  "twice; sharp: sharpness beside the middle photo\n");
  const PhotoMaps maps = MapsOf(views, input, options, !screen.masks.empty());
  absl::StrAppend(text, DescribeCounts(used, views.size()), "; ",
                  input.cameras_path.empty() ? "cameras would be searched for"
                                             : absl::StrCat("cameras: ", input.cameras_path),
                  "\n", depth, DescribeMemory(views, options, maps, MachineMemory()), "\n");
  for (const auto& notes : {screen.notes, DescribeWidePhotos(wide.photos), DescribeUnused(input)}) {
    for (const std::string& note : notes) absl::StrAppend(text, "note: ", note, "\n");
  }
  if (!others.empty()) absl::StrAppend(text, "note: ", others, "\n");
  if (input.cameras_path.empty()) {
    if (const std::string nearby = CamerasNearby(input); !nearby.empty()) {
      absl::StrAppend(text, "note: there are cameras in ", nearby, "; use them with --cameras\n");
    }
  }
  if (!sheet.empty()) {
    LITAGS_RETURN_IF_ERROR(WritePhotoSheet(used, thumbnails, sheet));
    absl::StrAppend(text, "contact sheet: ", sheet, "\n");
  }
  return CheckPhotoCount(views.size(), views.size() + used.left_out.size());
}

absl::Status CheckAllReadable(const ReconstructInput& input, int threads,
                              const CancelToken& cancel) {
  LITAGS_ASSIGN_OR_RETURN(const PhotoScreen screen, ScreenPhotos(input, threads, cancel));
  for (const PhotoLeftOut& photo : screen.left_out) {
    if (!photo.unreadable) continue;
    return InvalidInput("PHOTO_UNREADABLE", absl::StrCat("images[", photo.name, "]"),
                        absl::StrCat(photo.why, " (--strict; without it the photo is left out)"));
  }
  return absl::OkStatus();
}

bool IsVideoFile(const std::string& path) {
  std::error_code ignored;
  return IsVideoName(path) && fs::is_regular_file(path, ignored);
}

absl::Status CheckVideoIsThere(const std::string& path) {
  std::error_code ignored;
  if (!IsVideoName(path) || fs::exists(path, ignored)) return absl::OkStatus();
  return InvalidInput("NO_SUCH_FILE", "DIR",
                      absl::StrCat(path, ": there is no such file; give one that is there"));
}

absl::Status CheckFramesAreOfVideo(int frames, bool is_video) {
  if (is_video || frames == 0) return absl::OkStatus();
  return InvalidInput("OPTION_UNUSED", "--frames",
                      "--frames is for videos, and these are photos; leave it out");
}

absl::StatusOr<ReconstructInput> PickFramesNow(const ReconstructInput& input, int frames,
                                               const CancelToken& cancel) {
  std::vector<std::string> notes;
  const auto say = [](const std::string& text) { std::fprintf(stderr, "%s\n", text.c_str()); };
  LITAGS_ASSIGN_OR_RETURN(ReconstructInput picked,
                          WithFramesAsPhotos(input, frames, cancel, say, &notes));
  for (const std::string& note : notes) say("note: " + note);
  return picked;
}

ScratchFolder::ScratchFolder() {
  std::string pattern = fs::temp_directory_path() / "litags-inspect-XXXXXX";
  if (mkdtemp(pattern.data()) != nullptr) path_ = pattern;
}

ScratchFolder::~ScratchFolder() {
  std::error_code ignored;
  if (!path_.empty()) fs::remove_all(path_, ignored);
}

}  // namespace litags
