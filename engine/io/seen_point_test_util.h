// A point of the world, a camera, and where that sees it: what files of other programs must say,
// too.
#ifndef LITAGS_ENGINE_IO_SEEN_POINT_TEST_UTIL_H_
#define LITAGS_ENGINE_IO_SEEN_POINT_TEST_UTIL_H_

#include <array>
#include <cmath>

#include "engine/io/sparse_model.h"

namespace litags {

inline constexpr std::array<double, 3> kPoint = {0.3, -0.2, 2.5};
// cam_from_world: turned by 30 degrees about y.
inline const double kC = std::cos(M_PI / 6), kS = std::sin(M_PI / 6);
inline const std::array<double, 9> kRotation = {kC, 0, kS, 0, 1, 0, -kS, 0, kC};
inline constexpr std::array<double, 3> kCenter = {0.1, 0.4, -0.5};

// The point in the camera's plane at distance 1.
inline std::array<double, 2> OnPlane() {
  std::array<double, 3> d, p;
  for (int i = 0; i < 3; ++i) d[i] = kPoint[i] - kCenter[i];
  for (int r = 0; r < 3; ++r) {
    p[r] = kRotation[3 * r] * d[0] + kRotation[3 * r + 1] * d[1] + kRotation[3 * r + 2] * d[2];
  }
  return {p[0] / p[2], p[1] / p[2]};
}

// Where the first view of a model sees the point, px, from the picture's corner.
inline std::array<double, 2> Seen(const SparseModel& model) {
  const Camera& camera = model.views[0].camera;
  const auto p = camera.CamFromWorld(kPoint);
  const auto seen = Distort(model.distortions[0], p[0] / p[2], p[1] / p[2]);
  return {camera.fx * seen[0] + camera.cx, camera.fy * seen[1] + camera.cy};
}

}  // namespace litags

#endif  // LITAGS_ENGINE_IO_SEEN_POINT_TEST_UTIL_H_
