#include "server/jobs/start_checks.h"

#include <algorithm>
#include <map>
#include <optional>
#include <string>
#include <utility>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "engine/core/counted.h"
#include "engine/core/error.h"
#include "engine/core/limits.h"
#include "engine/core/mask.h"
#include "engine/core/photo_names.h"
#include "engine/pipeline/depth_maps.h"
#include "engine/pipeline/given_cameras.h"
#include "engine/pipeline/memory_estimate.h"
#include "engine/pipeline/photo_screen.h"
#include "engine/pipeline/video_frames.h"
#include "server/jobs/photo_looks.h"
#include "server/reader/file_findings.h"

namespace litags {
namespace {

// By role, then by name.
using Files = std::map<FileRole, std::map<std::string, const FileRecord*>>;

Files ByRole(const std::vector<FileRecord>& files) {
  Files by_role;
  for (const FileRecord& file : files) by_role[file.role][file.name] = &file;
  return by_role;
}

const std::map<std::string, const FileRecord*>& Of(const Files& files, FileRole role) {
  static const auto& none = *new std::map<std::string, const FileRecord*>;
  const auto found = files.find(role);
  return found == files.end() ? none : found->second;
}

std::vector<std::string> NamesOf(const Files& files, FileRole role) {
  std::vector<std::string> names;
  for (const auto& [name, file] : Of(files, role)) names.push_back(name);
  return names;
}

bool HasCameras(const Files& files) {
  return std::any_of(files.begin(), files.end(),
                     [](const auto& role) { return GivesCameras(role.first); });
}

// Whether the engine takes views of the photo for certain: its metadata say that it is a panorama.
bool HasViews(const FileRecord& photo, bool with_cameras) {
  const std::optional<PhotoFindings> findings = ParsePhotoFindings(photo.about);
  return findings && findings->has_views != 0 && !with_cameras;
}

// Whether it may: its edges may tell, or its camera.
bool IsPanoramaShaped(const FileRecord& photo) {
  return photo.width > 0 && photo.width == 2 * photo.height;
}

absl::Status CheckVideo(const Files& files) {
  const size_t videos = Of(files, FileRole::kVideo).size();
  const size_t photos = Of(files, FileRole::kPhoto).size();
  if (videos > 1 || photos > 0) {
    return MakeError(
        absl::StatusCode::kFailedPrecondition, "VIDEO_NOT_ALONE", "videos",
        absl::StrCat("the job has ", Counted(videos, "video"), " and ", Counted(photos, "photo"),
                     "; a job takes one video, or photos: delete the others "
                     "with DeleteFile, or make a job for each"));
  }
  std::vector<std::string> beside;
  if (HasCameras(files)) beside.emplace_back("cameras");
  const size_t maps = Of(files, FileRole::kDepth).size();
  if (maps > 0) beside.push_back(Counted(maps, "depth map"));
  const size_t masks = Of(files, FileRole::kMask).size();
  if (masks > 0) beside.push_back(Counted(masks, "mask"));
  return CheckVideoAlone(beside);
}

absl::Status CheckNumberOfPhotos(const Files& files) {
  const auto& photos = Of(files, FileRole::kPhoto);
  const bool with_cameras = HasCameras(files);
  const bool views = std::any_of(photos.begin(), photos.end(), [&](const auto& photo) {
    return HasViews(*photo.second, with_cameras) ||
           (with_cameras && IsPanoramaShaped(*photo.second));
  });
  return views ? absl::OkStatus() : CheckPhotoCount(photos.size(), photos.size());
}

// Of a COLMAP model's files the engine takes the form of the cameras, and .bin before .txt.
const char* FormOf(const std::map<std::string, const FileRecord*>& model) {
  return model.contains("cameras.bin") ? ".bin" : ".txt";
}

// The engine triangulates points that are not there.
absl::Status CheckColmap(const Files& files) {
  const auto& model = Of(files, FileRole::kColmap);
  if (model.empty()) return absl::OkStatus();
  const std::string ending = FormOf(model);
  if (model.contains("cameras" + ending) && model.contains("images" + ending)) {
    return absl::OkStatus();
  }
  const bool both = model.contains("cameras.bin") && model.contains("cameras.txt");
  return MakeError(
      absl::StatusCode::kFailedPrecondition, "COLMAP_INCOMPLETE", "colmap",
      absl::StrCat("the job has ", absl::StrJoin(NamesOf(files, FileRole::kColmap), ", "),
                   " of a COLMAP model",
                   both ? ", of which cameras.bin goes before cameras.txt" : "",
                   "; upload cameras.bin and images.bin, and "
                   "points3D.bin if there is one, or the same as .txt alone"));
}

// The file that names the cameras' photos; null if there is none.
const FileRecord* FileOfCameras(const Files& files) {
  if (const auto& cameras = Of(files, FileRole::kCameras); !cameras.empty()) {
    return cameras.begin()->second;
  }
  const auto& model = Of(files, FileRole::kColmap);
  const auto images = model.find(absl::StrCat("images", FormOf(model)));
  return images == model.end() ? nullptr : images->second;
}

// As the engine's ReadGivenCameras().
absl::Status CheckCamerasAreOfPhotos(const Files& files) {
  const FileRecord* const file = FileOfCameras(files);
  if (file == nullptr) return absl::OkStatus();
  const std::optional<CameraFindings> cameras = ParseCameraFindings(file->about);
  if (!cameras) return absl::OkStatus();
  const auto& photos = Of(files, FileRole::kPhoto);
  for (const auto& [name, photo] : photos) {
    if (cameras->MayHave(name)) return absl::OkStatus();
  }
  return NoMatchingCameras(photos.size(), photos.begin()->first, cameras->path);
}

// Whether cameras may say which mask is whose, as a transforms.json does.
bool MayNameMasks(const Files& files) {
  const auto& cameras = Of(files, FileRole::kCameras);
  return std::any_of(cameras.begin(), cameras.end(), [](const auto& file) {
    return absl::EndsWithIgnoreCase(file.first, ".json");
  });
}

// Every mask fits a photo. The engine finds them by the same rule, and by what a transforms.json
// says, which it alone reads.
absl::Status CheckMasks(const Files& files) {
  const std::vector<std::string> photos = NamesOf(files, FileRole::kPhoto);
  const bool named = MayNameMasks(files);
  if (!named) {
    LITAGS_RETURN_IF_ERROR(MatchMasks(photos, NamesOf(files, FileRole::kMask)).status());
  }
  const MaskMatcher matcher(photos);
  for (const auto& [name, mask] : Of(files, FileRole::kMask)) {
    const auto photo_name = matcher.PhotoOf(name);
    if (!photo_name.ok()) continue;  // the cameras name it
    const FileRecord& photo = *Of(files, FileRole::kPhoto).at(*photo_name);
    LITAGS_RETURN_IF_ERROR(
        CheckMaskSize(name, mask->width, mask->height, photo.width, photo.height));
  }
  return absl::OkStatus();
}

DepthOrigin OriginOfDepth(const Files& files, const ReconstructOptions& options) {
  ReconstructInput input;
  if (files.contains(FileRole::kDepth)) input.depth_dir = "depth";
  return ResolveDepthOrigin(options.ResolveRecipe(), options, input);
}

// As FindDepthMap() finds it; null if there is none.
const FileRecord* MapOf(const Files& files, const std::string& photo) {
  const auto& maps = Of(files, FileRole::kDepth);
  for (const std::string& name : DepthMapNames(photo)) {
    const auto found = maps.find(name);
    if (found != maps.end()) return found->second;
  }
  return nullptr;
}

// As the engine's CheckMapsFit().
absl::Status CheckMapsAreOfPhotos(const Files& files) {
  const bool with_cameras = HasCameras(files);
  const std::vector<std::string> photos = PhotosAmong(NamesOf(files, FileRole::kPhoto));
  const PhotoNames names(photos);
  bool any = false;
  for (const std::string& name : photos) {
    const FileRecord* const photo = Of(files, FileRole::kPhoto).at(name);
    for (const std::string& view : NamesOfViews(name)) any |= MapOf(files, view) != nullptr;
    if (HasViews(*photo, with_cameras)) continue;
    const FileRecord* const map = MapOf(files, name);
    if (map == nullptr) continue;
    any = true;
    if (IsPanoramaShaped(*photo)) continue;  // its views may be the photos
    const std::string field = absl::StrCat("depths[", map->name, "]");
    LITAGS_RETURN_IF_ERROR(CheckDepthMapIsOf(name, map->name, names, field));
    // The size of a map was not kept once.
    if (map->width == 0 || photo->width == 0) continue;
    LITAGS_RETURN_IF_ERROR(
        CheckDepthShape(map->width, map->height, photo->width, photo->height, field));
  }
  if (any) return absl::OkStatus();
  return InvalidInput(
      "DEPTH_MAP_WITHOUT_PHOTO", "depth",
      "depth: no map has the name of a photo; name maps as their photos, a.png "
      "for a.jpg, or as views of panoramas, a_front.png, or make a job with another "
      "depth source");
}

// As the engine's CheckDepthSource().
absl::Status CheckDepthMaps(const Files& files, const ReconstructOptions& options) {
  if (OriginOfDepth(files, options) != DepthOrigin::kMaps) return absl::OkStatus();
  if (files.contains(FileRole::kDepth)) return CheckMapsAreOfPhotos(files);
  return MakeError(absl::StatusCode::kFailedPrecondition, "DEPTH_MAPS_MISSING",
                   "options.depth_source",
                   "options.depth_source: maps were asked for and the job has none; upload depth "
                   "maps, or make a job with another source");
}

// As ScreenPhotos() will have it: photos, and those left out. nullopt where the engine may see
// others: views of wide photos, those that cameras name alone, what masks leave of them; or where
// rows do not say enough.
std::optional<PhotoScreen> ScreenAsFound(const Files& files) {
  if (HasCameras(files) || files.contains(FileRole::kMask)) return std::nullopt;
  std::vector<ScreenedPhoto> looks;
  for (const auto& [name, photo] : Of(files, FileRole::kPhoto)) {
    const std::optional<PhotoFindings> findings = ParsePhotoFindings(photo->about);
    if (!findings || findings->has_views != 0 || IsPanoramaShaped(*photo)) return std::nullopt;
    looks.push_back(LookOf(*photo, *findings, false));
  }
  if (PhotosAmong(NamesOf(files, FileRole::kPhoto)).size() < looks.size()) return std::nullopt;
  const std::vector<std::string> why = WhyLeftOutAsFound(looks);
  PhotoScreen screen;
  for (size_t i = 0; i < why.size(); ++i) {
    if (why[i].empty()) {
      screen.photos.push_back(std::move(looks[i]));
    } else {
      screen.left_out.push_back({std::move(looks[i].name), why[i]});
    }
  }
  return screen;
}

absl::StatusOr<int64_t> LeastMemory(const std::vector<ScreenedPhoto>& photos, DepthOrigin depth,
                                    const ReconstructOptions& options, int64_t most) {
  ReconstructOptions one_thread = options;
  one_thread.threads = 1;
  PhotoMaps maps;  // their sizes, where they are certain
  if (depth == DepthOrigin::kStereo) maps = MapsOf(photos, {}, one_thread, /*masks=*/false);
  LITAGS_RETURN_IF_ERROR(CheckMemory(photos, one_thread, maps, most));
  return EstimateMemory(photos, one_thread, 1, maps).Least();
}

}  // namespace

absl::StatusOr<int64_t> CheckFiles(const std::vector<FileRecord>& files,
                                   const ReconstructOptions& options, int64_t most_memory) {
  const Files by_role = ByRole(files);
  if (by_role.contains(FileRole::kVideo)) {
    LITAGS_RETURN_IF_ERROR(CheckVideo(by_role));
    LITAGS_RETURN_IF_ERROR(CheckDepthMaps(by_role, options));
    return 0;
  }
  LITAGS_RETURN_IF_ERROR(CheckNumberOfPhotos(by_role));
  LITAGS_RETURN_IF_ERROR(CheckColmap(by_role));
  LITAGS_RETURN_IF_ERROR(CheckCamerasAreOfPhotos(by_role));
  LITAGS_RETURN_IF_ERROR(CheckMasks(by_role));
  const std::optional<PhotoScreen> screen = ScreenAsFound(by_role);
  if (screen) LITAGS_RETURN_IF_ERROR(CheckPhotosLeft(screen->photos.size(), screen->left_out));
  LITAGS_RETURN_IF_ERROR(CheckDepthMaps(by_role, options));
  if (!screen) return 0;
  return LeastMemory(screen->photos, OriginOfDepth(by_role, options), options, most_memory);
}

}  // namespace litags
