#include "server/api/camera_path.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "server/api/view_request.h"

namespace litags {
namespace {

using Eigen::Vector3d;
using RowMatrix = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

constexpr int kDefaultFrames = 60, kMaxFrames = 10000;
constexpr double kMaxElevationDeg = 89;

Vector3d ToVector(const std::array<double, 3>& v) { return {v[0], v[1], v[2]}; }

struct Key {
  Vector3d center;
  Eigen::Quaterniond cam_from_world;
};

Key ToKey(const Camera& camera) {
  return {ToVector(camera.Center()),
          Eigen::Quaterniond(Eigen::Map<const RowMatrix>(camera.R.data()))};
}

Camera AtKey(const Camera& lens, const Key& key) {
  Camera camera = lens;
  const RowMatrix R = key.cam_from_world.normalized().toRotationMatrix();
  const Vector3d t = -R * key.center;
  std::copy_n(R.data(), 9, camera.R.begin());
  std::copy_n(t.data(), 3, camera.t.begin());
  return camera;
}

// Catmull-Rom: through p1 at u = 0 and p2 at u = 1.
Vector3d CatmullRom(const Vector3d& p0, const Vector3d& p1, const Vector3d& p2, const Vector3d& p3,
                    double u) {
  return 0.5 * (2 * p1 + u * (p2 - p0) + u * u * (2 * p0 - 5 * p1 + 4 * p2 - p3) +
                u * u * u * (3 * p1 - p0 - 3 * p2 + p3));
}

absl::StatusOr<std::vector<Camera>> Through(const v1::Keyframes& keyframes, int frames,
                                            const Camera& lens, const Scene& scene) {
  std::vector<Key> keys;
  for (int i = 0; i < keyframes.poses_size(); ++i) {
    LITAGS_ASSIGN_OR_RETURN(
        const Camera camera,
        ResolvePose(keyframes.poses(i), lens, scene, absl::StrCat("keyframes.poses[", i, "]")));
    keys.push_back(ToKey(camera));
  }
  const int n = static_cast<int>(keys.size());
  if (n < 2) {
    return InvalidInput("TOO_FEW_KEYFRAMES", "keyframes.poses",
                        absl::StrCat("a path through ", n, " poses; give at least 2"));
  }
  const bool closed = keyframes.closed();
  const int segments = closed ? n : n - 1;
  const auto key = [&](int i) -> const Key& {
    return keys[closed ? (i + n) % n : std::clamp(i, 0, n - 1)];
  };
  std::vector<Camera> cameras;
  for (int f = 0; f < frames; ++f) {
    // A closed path does not show its first frame again; an open one ends at its last keyframe.
    const double position = double(f) * segments / (closed ? frames : std::max(1, frames - 1));
    const int i = std::min(static_cast<int>(position), segments - 1);
    const double u = position - i;
    cameras.push_back(AtKey(lens, {CatmullRom(key(i - 1).center, key(i).center, key(i + 1).center,
                                              key(i + 2).center, u),
                                   key(i).cam_from_world.slerp(u, key(i + 1).cam_from_world)}));
  }
  return cameras;
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

absl::StatusOr<std::vector<Camera>> Around(const v1::Orbit& orbit, int frames, const Camera& lens,
                                           const Scene& scene) {
  const Vector3d center = ToVector(scene.center()), up = ToVector(scene.up()).normalized();
  const double scale = orbit.radius_scale() == 0 ? 1 : orbit.radius_scale();
  const double sweep_deg = orbit.sweep_deg() == 0 ? 360 : orbit.sweep_deg();
  if (!(scale > 0 && std::isfinite(scale))) {
    return InvalidInput("ORBIT_INVALID", "orbit.radius_scale",
                        absl::StrCat("radius_scale is ", scale, "; it must be positive"));
  }
  if (!std::isfinite(sweep_deg)) {
    return InvalidInput("ORBIT_INVALID", "orbit.sweep_deg", "sweep_deg must be a finite number");
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
  // The circle begins where the first photo was taken.
  Vector3d first = ToVector(scene.views().front().camera.Center()) - center;
  first -= first.dot(up) * up;
  if (first.norm() < 1e-9) first = up.unitOrthogonal();
  first.normalize();
  const Vector3d second = up.cross(first);
  const double radius = scale * scene.radius();
  // A full turn does not show its first frame again.
  const bool full = std::abs(sweep_deg) >= 360;
  const double step = sweep_deg * M_PI / 180 / (full ? frames : std::max(1, frames - 1));
  std::vector<Camera> cameras;
  for (int f = 0; f < frames; ++f) {
    const Vector3d out = std::cos(f * step) * first + std::sin(f * step) * second;
    const Vector3d eye = center + radius * (std::cos(elevation) * out + std::sin(elevation) * up);
    Camera camera = lens;
    LITAGS_RETURN_IF_ERROR(camera.LookAt({eye.x(), eye.y(), eye.z()}, scene.center(), scene.up()));
    cameras.push_back(camera);
  }
  return cameras;
}

}  // namespace

absl::StatusOr<std::vector<Camera>> ResolvePath(const v1::RenderPathRequest& request,
                                                const Camera& lens, const Scene& scene) {
  const int frames = request.frames() == 0 ? kDefaultFrames : request.frames();
  if (frames < 1 || frames > kMaxFrames) {
    return InvalidInput("FRAMES_INVALID", "frames",
                        absl::StrCat("frames is ", frames, "; it must be in 1..", kMaxFrames));
  }
  switch (request.path_case()) {
    case v1::RenderPathRequest::kKeyframes:
      return Through(request.keyframes(), frames, lens, scene);
    case v1::RenderPathRequest::kOrbit:
      return Around(request.orbit(), frames, lens, scene);
    case v1::RenderPathRequest::PATH_NOT_SET:
      break;
  }
  return InvalidInput("PATH_MISSING", "path", "no path is set; give keyframes or an orbit");
}

}  // namespace litags
