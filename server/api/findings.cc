#include "server/api/findings.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include "engine/pipeline/photo_look.h"
#include "server/api/convert.h"
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

ScreenedPhoto LookOf(const FileRecord& file, const PhotoFindings& findings, bool with_cameras) {
  ScreenedPhoto look;
  look.name = file.name;
  look.width = file.width;
  look.height = file.height;
  look.mean_code = findings.mean_code;
  look.light = findings.light;
  look.structure = findings.structure;
  look.sharpness = findings.sharpness;
  look.detail = {.fine = findings.fine_detail, .coarse = findings.coarse_detail};
  look.pixels = findings.pixels;
  look.has_views = findings.has_views != 0 && !with_cameras;
  return look;
}

}  // namespace

std::map<std::string, v1::PhotoFindings> FindingsOf(absl::Span<const FileRecord> files) {
  std::map<std::string, v1::PhotoFindings> found;
  std::vector<ScreenedPhoto> photos;
  const bool with_cameras = std::any_of(files.begin(), files.end(), [](const FileRecord& file) {
    return file.role == FileRole::kCameras || file.role == FileRole::kColmap;
  });
  for (const FileRecord& file : files) {
    if (file.role != FileRole::kPhoto) continue;
    const std::optional<PhotoFindings> findings = ParsePhotoFindings(file.about);
    if (!findings) continue;
    found[file.name] = ToProto(*findings);
    photos.push_back(LookOf(file, *findings, with_cameras));
  }
  const double middle = MiddleOf(photos, &ScreenedPhoto::light);
  const double middle_sharpness = MiddleOf(photos, &ScreenedPhoto::sharpness);
  std::vector<std::string> why = WhyLeftOut(photos);
  for (size_t i = 0; i < photos.size(); ++i) {
    v1::PhotoFindings& proto = found[photos[i].name];
    if (photos[i].light > 0 && middle > 0) proto.set_stops(std::log2(photos[i].light / middle));
    if (middle_sharpness > 0) proto.set_sharpness(photos[i].sharpness / middle_sharpness);
    // The engine leaves these out when it has cameras.
    if (why[i].empty() && photos[i].pixels.empty()) why[i] = "has pixels of one colour only";
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
