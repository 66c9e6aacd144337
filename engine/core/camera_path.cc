#include "engine/core/camera_path.h"

#include <Eigen/Geometry>
#include <algorithm>

#include "engine/core/check.h"

namespace litags {
namespace {

using Eigen::Vector3d;
using RowMatrix = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

struct Key {
  Vector3d center;
  Eigen::Quaterniond cam_from_world;
};

Key ToKey(const Camera& camera) {
  const auto c = camera.Center();
  return {{c[0], c[1], c[2]}, Eigen::Quaterniond(Eigen::Map<const RowMatrix>(camera.R.data()))};
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

}  // namespace

std::vector<Camera> PathThrough(const std::vector<Camera>& keys, int frames, bool closed,
                                const Camera& lens) {
  const int n = static_cast<int>(keys.size());
  LITAGS_CHECK(n >= 2);
  const auto key = [&](int i) {
    return ToKey(keys[closed ? (i + n) % n : std::clamp(i, 0, n - 1)]);
  };
  const int segments = closed ? n : n - 1;
  std::vector<Camera> path;
  for (int f = 0; f < frames; ++f) {
    const double position = double(f) * segments / (closed ? frames : std::max(1, frames - 1));
    const int i = std::min(static_cast<int>(position), segments - 1);
    const double u = position - i;
    const Key before = key(i), after = key(i + 1);
    path.push_back(AtKey(
        lens, {CatmullRom(key(i - 1).center, before.center, after.center, key(i + 2).center, u),
               before.cam_from_world.slerp(u, after.cam_from_world)}));
  }
  return path;
}

}  // namespace litags
