#include "engine/io/meshroom_io.h"

#include <array>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "engine/io/bounded_json.h"
#include "engine/io/io_error.h"
#include "engine/io/model_util.h"

namespace litags {
namespace {

using Json = nlohmann::json;

constexpr std::string_view kDropped[] = {"structure", "metadata", "featuresFolders",
                                         "matchesFolders"};

// Of the file's layout.
using Version = std::array<double, 3>;

absl::Status Bad(std::string_view where, std::string_view what) {
  return InvalidField("MISSING_KEY", where,
                      absl::StrCat(Absl(what), "; write the file again with Meshroom"));
}

absl::Status Unsupported(std::string_view where, std::string_view what) {
  return InvalidField("UNSUPPORTED_CAMERA_MODEL", where,
                      absl::StrCat("Meshroom's ", Absl(what),
                                   " is not read; undistort the photos first (node "
                                   "PrepareDenseScene), or choose a radial lens"));
}

// Focal lengths in px. What the file says of them has changed four times.
bool ReadFocals(const Json& lens, const Version& version, Camera* camera) {
  if (version < Version{1, 2, 0}) {
    camera->fy = 0;
    const bool good = ReadNumber(Member(lens, "pxFocalLength"), &camera->fx);
    camera->fy = camera->fx;
    return good;
  }
  if (version < Version{1, 2, 2}) {
    double focals[2] = {};
    const bool good = ReadNumbers(Member(lens, "pxFocalLength"), focals);
    camera->fx = focals[0];
    camera->fy = focals[1];
    return good;
  }
  double focal_mm = 0, sensor_mm = 0, ratio = 1;
  if (!ReadNumber(Member(lens, "focalLength"), &focal_mm) ||
      !ReadNumber(Member(lens, "sensorWidth"), &sensor_mm) || !(sensor_mm > 0)) {
    return false;
  }
  ReadNumber(Member(lens, "pixelRatio"), &ratio);
  camera->fx = focal_mm / sensor_mm * camera->width;
  // Before 1.2.5 the ratio was that of the focal lengths, since then it is that of a pixel's sides.
  camera->fy = version < Version{1, 2, 5} ? camera->fx / ratio : camera->fx * ratio;
  return true;
}

absl::Status ReadDistortion(const Json& lens, std::string_view where, Distortion* d) {
  const std::string type = TextOf(Member(lens, "type"));
  const std::string kind = TextOf(Member(lens, "distortionType"));
  const Json& params = Member(lens, "distortionParams");
  const bool none = kind == "none" || !params.is_array() || params.empty();
  size_t count = 0;
  if (type == "radial1" || kind == "radialk1") count = 1;
  if (type == "radial3" || kind == "radialk3") count = 3;
  if (type != "pinhole" && type != "radial1" && type != "radial3") {
    return Unsupported(where, absl::StrCat("lens '", type, "'"));
  }
  if (none) return absl::OkStatus();
  if (count == 0 && kind.empty()) return absl::OkStatus();  // a pinhole's are not looked at
  if (count == 0) return Unsupported(where, absl::StrCat("distortion '", kind, "'"));
  std::vector<double> k(count);
  if (!ReadNumbers(params, k))
    return Bad(where, "its distortionParams are not as many as its type");
  k.resize(3);
  d->k1 = k[0];
  d->k2 = k[1];
  d->k3 = k[2];
  return absl::OkStatus();
}

absl::StatusOr<LoadedView> ReadLens(const Json& entry, const Version& version,
                                    std::string_view where) {
  LoadedView lens;
  double width = 0, height = 0, center[2] = {};
  if (!ReadNumber(Member(entry, "width"), &width) ||
      !ReadNumber(Member(entry, "height"), &height) ||
      !ReadNumbers(Member(entry, "principalPoint"), center)) {
    return Bad(where, "it lacks width, height or principalPoint");
  }
  LITAGS_RETURN_IF_ERROR(SetSize(width, height, where, &lens.view.camera));
  lens.has_size = true;
  if (!ReadFocals(entry, version, &lens.view.camera))
    return Bad(where, "it lacks its focal length");
  // Since 1.2.1 it counts from the middle.
  const bool from_corner = version < Version{1, 2, 1};
  lens.view.camera.cx = center[0] + (from_corner ? 0 : 0.5 * width) + 0.5;
  lens.view.camera.cy = center[1] + (from_corner ? 0 : 0.5 * height) + 0.5;
  LITAGS_RETURN_IF_ERROR(ReadDistortion(entry, where, &lens.distortion));
  return lens;
}

// cam_from_world's rotation, column by column, and the centre.
absl::Status ReadPose(const Json& pose, std::string_view where, Camera* camera) {
  const Json& transform = Member(Member(pose, "pose"), "transform");
  double columns[9], center[3];
  if (!ReadNumbers(Member(transform, "rotation"), columns) ||
      !ReadNumbers(Member(transform, "center"), center)) {
    return Bad(where, "its pose lacks rotation or center");
  }
  double rows[9];
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 3; ++c) rows[3 * r + c] = columns[3 * c + r];
  }
  return SetPlace(rows, center, where, camera);
}

}  // namespace

bool IsMeshroom(std::string_view json) {
  return json.find("\"viewId\"") != std::string_view::npos &&
         json.find("\"intrinsicId\"") != std::string_view::npos;
}

absl::StatusOr<SparseModel> ParseMeshroom(std::string_view json, std::string_view field) {
  LITAGS_ASSIGN_OR_RETURN(const Json top, ParseBoundedJson(json, field, kDropped));
  Version version = {};
  if (!ReadNumbers(Member(top, "version"), version)) {
    return Bad(field, "it lacks its version");
  }
  std::map<std::string, LoadedView> lenses;
  for (const Json& entry : Member(top, "intrinsics")) {
    const std::string id = TextOf(Member(entry, "intrinsicId"));
    LITAGS_ASSIGN_OR_RETURN(
        lenses[id], ReadLens(entry, version, absl::StrCat(Absl(field), ".intrinsics[", id, "]")));
  }
  std::map<std::string, const Json*> poses;
  for (const Json& entry : Member(top, "poses")) poses[TextOf(Member(entry, "poseId"))] = &entry;
  std::vector<LoadedView> views;
  for (const Json& entry : Member(top, "views")) {
    const auto pose = poses.find(TextOf(Member(entry, "poseId")));
    if (pose == poses.end()) continue;  // Meshroom could not place it
    const std::string name = TextOf(Member(entry, "path"));
    const std::string where = absl::StrCat(Absl(field), ".views[", name, "]");
    if (!Member(entry, "rigId").is_null()) return Unsupported(where, "rig of several cameras");
    const auto lens = lenses.find(TextOf(Member(entry, "intrinsicId")));
    if (lens == lenses.end()) return Bad(where, "its intrinsicId names no lens");
    LoadedView loaded = lens->second;
    loaded.view.name = name;
    LITAGS_RETURN_IF_ERROR(ReadPose(*pose->second, where, &loaded.view.camera));
    views.push_back(std::move(loaded));
  }
  if (views.empty()) {
    return InvalidField("NO_CAMERAS", field,
                        "no view has a pose; give the cameras.sfm that StructureFromMotion wrote");
  }
  return FinishModel(std::move(views), field, nullptr);
}

}  // namespace litags
