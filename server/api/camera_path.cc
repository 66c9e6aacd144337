#include "server/api/camera_path.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "absl/strings/str_cat.h"
#include "engine/core/camera_path.h"
#include "engine/core/counted.h"
#include "engine/core/error.h"
#include "server/api/view_request.h"

namespace litags {
namespace {

using Eigen::Vector3d;

constexpr int kDefaultFrames = 60, kMaxFrames = 10000, kMaxKeyframes = 10000;
constexpr double kMaxElevationDeg = 89;
// Beyond, rounding leaves nothing of the picture.
constexpr double kMaxRadiusScale = 1e6, kMaxSweepDeg = 36000;
// Photos with no larger gap between them surround the scene; the rest is for rounding.
constexpr double kMaxGapDeg = 90 + 1e-6;

Vector3d ToVector(const std::array<double, 3>& v) { return {v[0], v[1], v[2]}; }

absl::StatusOr<std::vector<Camera>> Through(const v1::Keyframes& keyframes, int frames,
                                            const Camera& lens, const Scene& scene,
                                            const CancelToken& cancel) {
  if (keyframes.poses_size() > kMaxKeyframes) {
    return InvalidInput("TOO_MANY_KEYFRAMES", "keyframes.poses",
                        absl::StrCat("a path through ", keyframes.poses_size(),
                                     " poses; give at most ", kMaxKeyframes));
  }
  CameraFinder cameras(scene);
  std::vector<Camera> keys;
  for (int i = 0; i < keyframes.poses_size(); ++i) {
    LITAGS_RETURN_IF_ERROR(cancel.Check());
    LITAGS_ASSIGN_OR_RETURN(
        const Camera camera,
        ResolvePose(keyframes.poses(i), lens, cameras, absl::StrCat("keyframes.poses[", i, "]")));
    keys.push_back(camera);
  }
  if (keys.size() < 2) {
    return InvalidInput(
        "TOO_FEW_KEYFRAMES", "keyframes.poses",
        absl::StrCat("a path through ", Counted(keys.size(), "pose"), "; give at least 2"));
  }
  return PathThrough(keys, frames, keyframes.closed(), lens);
}

// The photos' mean angle above the plane through the centre, radians.
double MeanElevation(const Scene& scene, const Vector3d& center, const Vector3d& up) {
  double sum = 0;
  for (const View& view : scene.views()) {
    const Vector3d d = ToVector(view.camera.Center()) - center;
    if (d.norm() > 0) sum += std::asin(std::clamp(d.dot(up) / d.norm(), -1.0, 1.0));
  }
  const double limit = kMaxElevationDeg * M_PI / 180;
  return std::clamp(sum / static_cast<double>(scene.views().size()), -limit, limit);
}

// The part of a circle that the photos cover, as angles from its first axis to its second, radians:
// all but the largest gap between two neighbours.
struct Arc {
  double begin = 0, sweep = 0;
};

Arc CoveredArc(const Scene& scene, const Vector3d& center, const Vector3d& first,
               const Vector3d& second) {
  std::vector<double> angles;
  for (const View& view : scene.views()) {
    const Vector3d d = ToVector(view.camera.Center()) - center;
    angles.push_back(std::atan2(d.dot(second), d.dot(first)));
  }
  std::sort(angles.begin(), angles.end());
  double largest = 0, begin = 0;  // of a gap, and where it ends
  for (size_t i = 0; i < angles.size(); ++i) {
    const double before = i > 0 ? angles[i - 1] : angles.back() - 2 * M_PI;
    if (angles[i] - before <= largest) continue;
    largest = angles[i] - before;
    begin = angles[i];
  }
  return {begin, 2 * M_PI - largest};
}

// Where on its circle each frame of an orbit stands, by the axes of CoveredArc().
std::vector<double> OrbitAngles(std::optional<double> sweep_deg, const Arc& covered, int frames) {
  const bool surrounded = 2 * M_PI - covered.sweep <= kMaxGapDeg * M_PI / 180;
  std::vector<double> angles;
  for (int f = 0; f < frames; ++f) {
    if (!sweep_deg && !surrounded) {
      // There and back, slowest where it turns: behind the arc nothing was seen.
      const double part = 0.5 - 0.5 * std::cos(2 * M_PI * f / frames);
      angles.push_back(covered.begin + part * covered.sweep);
      continue;
    }
    // From the first photo on. A full turn does not show its first frame again.
    const double turn_deg = sweep_deg.value_or(360);
    const int steps = std::abs(turn_deg) >= 360 ? frames : std::max(1, frames - 1);
    angles.push_back(f * turn_deg * M_PI / 180 / steps);
  }
  return angles;
}

absl::StatusOr<std::vector<Camera>> Around(const v1::Orbit& orbit, int frames, const Camera& lens,
                                           const Scene& scene) {
  const Vector3d center = ToVector(scene.center()), up = ToVector(scene.up()).normalized();
  const double scale = orbit.radius_scale() == 0 ? 1 : orbit.radius_scale();
  if (!(scale >= 1 / kMaxRadiusScale && scale <= kMaxRadiusScale)) {
    return InvalidInput("ORBIT_INVALID", "orbit.radius_scale",
                        absl::StrCat("radius_scale is ", scale,
                                     "; it must lie between 1e-6 and 1e6, or be 0 for 1"));
  }
  if (!(std::abs(orbit.sweep_deg()) <= kMaxSweepDeg)) {
    return InvalidInput("ORBIT_INVALID", "orbit.sweep_deg",
                        absl::StrCat("sweep_deg is ", orbit.sweep_deg(),
                                     "; it must lie between -36000 and 36000, a hundred turns"));
  }
  double elevation = MeanElevation(scene, center, up);
  if (orbit.has_elevation_deg()) {
    if (!(std::abs(orbit.elevation_deg()) < kMaxElevationDeg)) {
      return InvalidInput("ORBIT_INVALID", "orbit.elevation_deg",
                          absl::StrCat("elevation_deg is ", orbit.elevation_deg(),
                                       "; it must be between -89 and 89"));
    }
    elevation = orbit.elevation_deg() * M_PI / 180;
  }
  // The circle's first axis points to where the first photo was taken.
  Vector3d first = ToVector(scene.views().front().camera.Center()) - center;
  first -= first.dot(up) * up;
  if (first.norm() < 1e-9) first = up.unitOrthogonal();
  first.normalize();
  const Vector3d second = up.cross(first);
  const double radius = scale * scene.radius();
  const Arc covered = CoveredArc(scene, center, first, second);
  std::vector<Camera> cameras;
  const auto sweep_deg = orbit.has_sweep_deg() ? std::optional(orbit.sweep_deg()) : std::nullopt;
  for (const double angle : OrbitAngles(sweep_deg, covered, frames)) {
    const Vector3d out = std::cos(angle) * first + std::sin(angle) * second;
    const Vector3d eye = center + radius * (std::cos(elevation) * out + std::sin(elevation) * up);
    Camera camera = lens;
    if (!camera.LookAt({eye.x(), eye.y(), eye.z()}, scene.center(), scene.up()).ok()) {
      return InvalidInput("ORBIT_INVALID", "orbit",
                          "the scene's photos give no circle to fly; give keyframes instead");
    }
    cameras.push_back(camera);
  }
  return cameras;
}

}  // namespace

absl::StatusOr<std::vector<Camera>> ResolvePath(const v1::RenderPathRequest& request,
                                                const Camera& lens, const Scene& scene,
                                                const CancelToken& cancel) {
  const int frames = request.frames() == 0 ? kDefaultFrames : request.frames();
  if (frames < 1 || frames > kMaxFrames) {
    return InvalidInput("FRAMES_INVALID", "frames",
                        absl::StrCat("frames is ", frames, "; it must be in 1..", kMaxFrames));
  }
  switch (request.path_case()) {
    case v1::RenderPathRequest::kKeyframes:
      return Through(request.keyframes(), frames, lens, scene, cancel);
    case v1::RenderPathRequest::kOrbit:
      return Around(request.orbit(), frames, lens, scene);
    case v1::RenderPathRequest::PATH_NOT_SET:
      break;
  }
  return InvalidInput("PATH_MISSING", "path", "no path is set; give keyframes or an orbit");
}

}  // namespace litags
