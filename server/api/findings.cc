#include "server/api/findings.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <set>
#include <utility>
#include <vector>

#include "engine/core/photo_names.h"
#include "engine/pipeline/photo_look.h"
#include "server/api/convert.h"
#include "server/jobs/photo_looks.h"
#include "server/reader/file_findings.h"

namespace litags {
namespace {

v1::PhotoFindings ToProto(const PhotoFindings& findings) {
  v1::PhotoFindings proto;
  proto.set_focal_length_mm(findings.focal_length);
  proto.set_exposure_seconds(findings.exposure_time);
  proto.set_iso(findings.iso);
  proto.set_f_number(findings.f_number);
  proto.set_mean_code(findings.mean_code);
  return proto;
}

// As the engine's ScreenPhotos().
void MarkNamed(absl::Span<const FileRecord> files, std::vector<ScreenedPhoto>* photos) {
  if (!HasCopies(*photos)) return;
  std::set<std::string> maps;
  for (const FileRecord& file : files) {
    if (file.role == FileRole::kDepth) maps.insert(file.name);
    if (!GivesCameras(file.role)) continue;
    const std::optional<CameraFindings> cameras = ParseCameraFindings(file.about);
    if (!cameras) continue;
    for (ScreenedPhoto& photo : *photos) {
      photo.named_by_cameras = std::max(photo.named_by_cameras, cameras->HowNamed(photo.name));
    }
  }
  for (ScreenedPhoto& photo : *photos) {
    const std::vector<std::string> names = DepthMapNames(photo.name);
    photo.has_depth_map = std::any_of(names.begin(), names.end(),
                                      [&](const std::string& name) { return maps.contains(name); });
  }
}

}  // namespace

std::map<std::string, v1::PhotoFindings> FindingsOf(absl::Span<const FileRecord> files) {
  std::map<std::string, v1::PhotoFindings> found;
  std::vector<ScreenedPhoto> photos;
  const bool with_cameras = std::any_of(
      files.begin(), files.end(), [](const FileRecord& file) { return GivesCameras(file.role); });
  for (const FileRecord& file : files) {
    if (file.role != FileRole::kPhoto) continue;
    const std::optional<PhotoFindings> findings = ParsePhotoFindings(file.about);
    if (!findings) continue;
    found[file.name] = ToProto(*findings);
    photos.push_back(LookOf(file, *findings, with_cameras));
  }
  MarkNamed(files, &photos);
  const double middle = MiddleOf(photos, &ScreenedPhoto::light);
  const double middle_sharpness = MiddleOf(photos, &ScreenedPhoto::sharpness);
  std::vector<std::string> why = WhyLeftOutAsFound(photos);
  for (size_t i = 0; i < photos.size(); ++i) {
    v1::PhotoFindings& proto = found[photos[i].name];
    if (photos[i].light > 0 && middle > 0) proto.set_stops(std::log2(photos[i].light / middle));
    if (middle_sharpness > 0) proto.set_sharpness(photos[i].sharpness / middle_sharpness);
    proto.set_left_out(std::move(why[i]));
  }
  return found;
}

std::optional<v1::VideoFindings> FoundInVideo(const FileRecord& file) {
  if (file.role != FileRole::kVideo) return std::nullopt;
  const std::optional<VideoFindings> findings = ParseVideoFindings(file.about);
  if (!findings) return std::nullopt;
  v1::VideoFindings proto;
  if (findings->seconds > 0) *proto.mutable_duration() = DurationToProto(findings->seconds);
  proto.set_frames(std::llround(findings->frames));
  return proto;
}

}  // namespace litags
