// Pictures of a sphere before a wall, with exact depth.
#ifndef LITAGS_ENGINE_SURFACE_SURFACE_TEST_UTIL_H_
#define LITAGS_ENGINE_SURFACE_SURFACE_TEST_UTIL_H_

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "engine/surface/surface_picture.h"

namespace litags {

inline constexpr double kRadius = 1;     // of the red sphere around the world's origin
inline constexpr double kWallDepth = 2;  // of the green wall, along z

// Where a ray from `eye` along `way` meets the sphere, else the wall; in lengths of `way`.
inline std::pair<double, bool> Trace(const std::array<double, 3>& eye,
                                     const std::array<double, 3>& way) {
  double a = 0, b = 0, c = -kRadius * kRadius;
  for (int k = 0; k < 3; ++k) {
    a += way[k] * way[k];
    b += way[k] * eye[k];
    c += eye[k] * eye[k];
  }
  const double root = b * b - a * c;
  if (root > 0) return {(-b - std::sqrt(root)) / a, true};
  return {(kWallDepth - eye[2]) / way[2], false};
}

// What a camera at `eye` sees that looks at the sphere. `offset` is added to every depth.
inline SurfacePicture PictureFrom(const std::array<double, 3>& eye, double offset = 0) {
  SurfacePicture picture;
  Camera& camera = picture.camera;
  camera.width = camera.height = 120;
  camera.fx = camera.fy = 120;
  camera.cx = camera.cy = 60;
  EXPECT_TRUE(camera.LookAt(eye, {0, 0, 0}, {0, -1, 0}).ok());
  picture.depth = Planes(1, 120, 120);
  picture.color = ImageU8(120, 120);
  for (int y = 0; y < 120; ++y) {
    for (int x = 0; x < 120; ++x) {
      const auto ahead = camera.WorldFromCam({(x + 0.5 - 60) / 120, (y + 0.5 - 60) / 120, 1});
      const auto [depth, sphere] =
          Trace(eye, {ahead[0] - eye[0], ahead[1] - eye[1], ahead[2] - eye[2]});
      picture.depth.at(0, y, x) = static_cast<float>(depth + offset);
      picture.color.pixel(x, y)[sphere ? 0 : 1] = 200;
    }
  }
  return picture;
}

inline std::vector<SurfacePicture> FourPictures() {
  std::vector<SurfacePicture> pictures;
  for (const auto& [x, y] : {std::pair{-1.5, 0.0}, {1.5, 0.0}, {0.0, -1.5}, {0.0, 1.5}}) {
    pictures.push_back(PictureFrom({x, y, -3}));
  }
  return pictures;
}

// From the nearer of the sphere and the wall, scene units.
inline double DistanceToSurface(const std::array<double, 3>& point) {
  return std::min(std::abs(std::hypot(point[0], point[1], point[2]) - kRadius),
                  std::abs(point[2] - kWallDepth));
}

}  // namespace litags

#endif  // LITAGS_ENGINE_SURFACE_SURFACE_TEST_UTIL_H_
