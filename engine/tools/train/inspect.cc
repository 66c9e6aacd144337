#include "engine/tools/train/inspect.h"

#include <cmath>
#include <filesystem>
#include <set>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "engine/core/error.h"
#include "engine/io/cameras_io.h"
#include "engine/io/image_io.h"
#include "engine/pipeline/given_cameras.h"
#include "engine/pipeline/photo_screen.h"

namespace litags {
namespace {

namespace fs = std::filesystem;

std::string Stops(double light, double middle) {
  if (!(light > 0) || !(middle > 0)) return "-";
  return absl::StrFormat("%+.1f", std::log2(light / middle));
}

std::string Lens(const ReconstructInput& input, const std::string& name) {
  const auto info = ReadImageSize(input.images_dir + "/" + name, name);
  if (!info.ok() || info->focal_length == 0) return "-";
  return absl::StrFormat("%g mm", info->focal_length);
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

}  // namespace

absl::StatusOr<std::string> InspectFolder(const ReconstructInput& given, int threads,
                                          const CancelToken& cancel) {
  ReconstructInput input = given;
  LITAGS_ASSIGN_OR_RETURN(const std::string others,
                          DescribeOtherPictures(input.images_dir, "images"));
  LITAGS_ASSIGN_OR_RETURN(PhotoScreen screen, ScreenPhotos(input, threads, cancel));
  std::set<std::string> with_camera;
  if (!input.cameras_path.empty() && !screen.photos.empty()) {
    input.cameras_path = ResolveCameras(input.cameras_path);
    LITAGS_ASSIGN_OR_RETURN(const SparseModel model,
                            ReadGivenCameras(input, screen.Names(), &screen.notes));
    for (const View& view : model.views) with_camera.insert(view.name);
  }
  std::string text =
      absl::StrFormat("%-32s %-11s %-8s %6s %6s  %-5s%s\n", "photo", "px", "lens", "code", "stops",
                      "mask", input.cameras_path.empty() ? "" : " camera");
  for (const ScreenedPhoto& photo : screen.photos) {
    absl::StrAppendFormat(&text, "%-32s %-11s %-8s %6.1f %6s  %-5s%s\n", photo.name,
                          absl::StrCat(photo.width, "x", photo.height), Lens(input, photo.name),
                          photo.mean_code, Stops(photo.light, screen.middle_light),
                          screen.masks.contains(photo.name) ? "yes" : "-",
                          input.cameras_path.empty()         ? ""
                          : with_camera.contains(photo.name) ? " yes"
                                                             : " none: left out");
  }
  absl::StrAppend(&text, screen.photos.size(), " photos would be used, ", screen.left_out.size(),
                  " are left out; ",
                  input.cameras_path.empty() ? "cameras would be searched for"
                                             : absl::StrCat("cameras: ", input.cameras_path),
                  "\n");
  for (const std::string& note : screen.notes) absl::StrAppend(&text, "note: ", note, "\n");
  if (!others.empty()) absl::StrAppend(&text, "note: ", others, "\n");
  if (input.cameras_path.empty()) {
    if (const std::string nearby = CamerasNearby(input); !nearby.empty()) {
      absl::StrAppend(&text, "note: there are cameras in ", nearby, "; use them with --cameras\n");
    }
  }
  return text;
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

}  // namespace litags
