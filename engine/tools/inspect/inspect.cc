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
#include "proto/arguments/arguments.h"

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
  std::error_code ignored;
  const fs::path photos = fs::absolute(input.images_dir, ignored).lexically_normal();
  for (const fs::path& dir : {photos, photos.parent_path()}) {
    const std::string found = ResolveCameras(dir);
    if (found != dir.string()) return found;
  }
  return "";
}

// Reads the depth maps of the photos: "depth maps: 4 of 5 photos have one". Errors and `notes` of
// CheckMapsFit, errors of maps.
absl::StatusOr<std::string> DescribeDepthMaps(const ReconstructInput& input,
                                              const std::vector<ScreenedPhoto>& photos,
                                              const CancelToken& cancel,
                                              std::vector<std::string>* notes) {
  LITAGS_RETURN_IF_ERROR(CheckMapsFit(CutInput(input), notes));
  size_t maps = 0;
  for (const ScreenedPhoto& photo : photos) {
    LITAGS_RETURN_IF_ERROR(cancel.Check());
    const std::string path = FindDepthMap(input.depth_dir, photo.name);
    if (path.empty()) continue;
    LITAGS_RETURN_IF_ERROR(ReadDepthMap(path, absl::StrCat("depth/", BaseName(path))).status());
    ++maps;
  }
  return absl::StrCat("depth maps: ", maps, " of ", Counted(photos.size(), "photo"),
                      maps == 1 ? " has one\n" : " have one\n");
}

// What a run would read and make of a folder.
struct Inspection {
  ReconstructInput input;  // with the model of the cameras that is read
  std::string others;      // of pictures that are not read
  PhotoScreen screen, used;
  WidePhotos wide;
  std::set<std::string> with_camera;
  std::vector<ScreenedPhoto> views;  // that would be trained on
  std::string depth;                 // a line on the depth maps, if there are some
};

absl::StatusOr<Inspection> Inspect(const ReconstructInput& given, int threads,
                                   const CancelToken& cancel) {
  Inspection found;
  found.input = given;
  ReconstructInput& input = found.input;
  PhotoScreen& screen = found.screen;
  LITAGS_ASSIGN_OR_RETURN(found.others, DescribeOtherPictures(input.images_dir, "images"));
  LITAGS_ASSIGN_OR_RETURN(screen, ScreenPhotos(CutInput(input), threads, cancel));
  LITAGS_ASSIGN_OR_RETURN(found.wide, FindWidePhotos(input, screen.Names(), threads, cancel));
  if (!input.cameras_path.empty() && !screen.photos.empty()) {
    input.cameras_path = ResolveCameras(input.cameras_path);
    PanoramaNames panoramas;
    LITAGS_ASSIGN_OR_RETURN(const SparseModel model,
                            ReadGivenCameras(input, screen.Names(), &screen.notes, &panoramas));
    for (const View& view : model.views) found.with_camera.insert(view.name);
    for (const WidePhoto& photo : found.wide.photos) found.with_camera.insert(photo.name);
  }
  found.used =
      input.cameras_path.empty() ? screen : LeaveOutWithoutCamera(screen, found.with_camera);
  found.views = WithViews(found.used.photos, ByName(found.wide));
  if (input.depth_dir.empty() || found.used.photos.empty()) return found;
  found.depth = "depth maps: not looked at, since they are of the views\n";
  if (found.wide.photos.empty()) {
    LITAGS_ASSIGN_OR_RETURN(found.depth,
                            DescribeDepthMaps(input, found.used.photos, cancel, &screen.notes));
  }
  return found;
}

// A line for each photo.
std::string TableOf(const Inspection& found) {
  const ReconstructInput& input = found.input;
  const PhotoScreen& screen = found.screen;
  const std::map<std::string, const WidePhoto*> wide_by_name = ByName(found.wide);
  const double middle_sharpness = MiddleOf(screen.photos, &ScreenedPhoto::sharpness);
  const double middle_light = MiddleOf(screen.photos, &ScreenedPhoto::light);
  constexpr size_t kNameWidth = 32;
  constexpr char kLine[] = "%s %-11s %-17s %-22s %6s %6s %6s  %-5s%s\n";
  std::string text =
      absl::StrFormat(kLine, Padded("photo", kNameWidth), "px", "lens", "exposure", "code", "stops",
                      "sharp", "mask", input.cameras_path.empty() ? "" : " camera");
  for (const ScreenedPhoto& photo : screen.photos) {
    const auto wide = wide_by_name.find(photo.name);
    absl::StrAppendFormat(
        &text, kLine, Padded(photo.name, kNameWidth), absl::StrCat(photo.width, "x", photo.height),
        Lens(photo.info, wide == wide_by_name.end() ? nullptr : wide->second), Exposure(photo.info),
        absl::StrFormat("%.1f", photo.mean_code), Stops(photo.light, middle_light),
        absl::StrFormat("%.2f", middle_sharpness > 0 ? photo.sharpness / middle_sharpness : 0),
        screen.masks.contains(photo.name) ? "yes" : "-",
        input.cameras_path.empty()               ? ""
        : found.with_camera.contains(photo.name) ? " yes"
                                                 : " none: left out");
  }
  absl::StrAppend(&text,
                  "code: mean pixel value of 255; stops: light beside the middle photo, +1 is "
                  "twice; sharp: sharpness beside the middle photo\n");
  return text;
}

// What a run would use, and take.
std::string SummaryOf(const Inspection& found, const ReconstructOptions& options) {
  const ReconstructInput& input = found.input;
  const PhotoMaps maps = MapsOf(found.views, input, options, !found.screen.masks.empty());
  return absl::StrCat(DescribeCounts(found.used, found.views.size()), "; ",
                      input.cameras_path.empty() ? "cameras would be searched for"
                                                 : absl::StrCat("cameras: ", input.cameras_path),
                      "\n", found.depth,
                      DescribeMemory(found.views, options, maps, MachineMemory()), "\n");
}

std::vector<std::string> NotesOf(const Inspection& found) {
  std::vector<std::string> notes = found.screen.notes;
  for (const auto& more : {DescribeWidePhotos(found.wide.photos), DescribeUnused(found.input)}) {
    notes.insert(notes.end(), more.begin(), more.end());
  }
  if (!found.others.empty()) notes.push_back(found.others);
  if (!found.input.cameras_path.empty()) return notes;
  if (const std::string nearby = CamerasNearby(found.input); !nearby.empty()) {
    notes.push_back(absl::StrCat("there are cameras in ", nearby, "; use them with --cameras"));
  }
  return notes;
}

}  // namespace

absl::Status InspectFolder(const ReconstructInput& input, const ReconstructOptions& options,
                           const std::string& sheet, const CancelToken& cancel, std::string* text) {
  const int threads = options.threads > 0 ? options.threads : DefaultThreadCount();
  if (!sheet.empty()) LITAGS_RETURN_IF_ERROR(CheckSheetPath(sheet));
  LITAGS_RETURN_IF_ERROR(CheckHoldsPhotos(input.images_dir));
  LITAGS_ASSIGN_OR_RETURN(const Inspection found, Inspect(input, threads, cancel));
  const std::string thumbnails = input.work_dir + "/thumbnails";
  if (!sheet.empty()) {
    std::error_code ignored;  // writing the sheet says what is wrong
    fs::create_directories(thumbnails, ignored);
    WriteThumbnails(found.input, found.used, threads, thumbnails, cancel);
  }
  LITAGS_RETURN_IF_ERROR(cancel.Check());
  *text = TableOf(found) + SummaryOf(found, options);
  for (const std::string& note : NotesOf(found)) absl::StrAppend(text, "note: ", note, "\n");
  if (!sheet.empty()) {
    LITAGS_RETURN_IF_ERROR(WritePhotoSheet(found.used, thumbnails, sheet));
    absl::StrAppend(text, "contact sheet: ", sheet, "\n");
  }
  return CheckPhotoCount(found.views.size(), found.views.size() + found.used.left_out.size());
}

absl::Status CheckAllReadable(const ReconstructInput& input, int threads,
                              const CancelToken& cancel) {
  LITAGS_ASSIGN_OR_RETURN(const PhotoScreen screen, ScreenPhotos(CutInput(input), threads, cancel));
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
  const auto say = [](const std::string& text) {
    std::fprintf(stderr, "%s\n", WithoutControls(text).c_str());
  };
  LITAGS_ASSIGN_OR_RETURN(ReconstructInput picked,
                          WithFramesAsPhotos(input, frames, cancel, say, &notes));
  for (const std::string& note : notes) say("note: " + note);
  return picked;
}

ScratchFolder::ScratchFolder() {
  std::error_code none;  // TMPDIR may name no folder
  const fs::path folder = fs::temp_directory_path(none);
  std::string pattern = (none ? fs::path("/tmp") : folder) / "litags-inspect-XXXXXX";
  if (mkdtemp(pattern.data()) != nullptr) path_ = pattern;
}

ScratchFolder::~ScratchFolder() {
  std::error_code ignored;
  if (!path_.empty()) fs::remove_all(path_, ignored);
}

}  // namespace litags
