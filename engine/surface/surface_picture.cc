#include "engine/surface/surface_picture.h"

#include <algorithm>
#include <cmath>

#include "engine/core/quantile.h"

namespace litags {
namespace {

constexpr int kAgreementStep = 8;        // pixels along both axes that are compared
constexpr double kAgreementShare = 0.9;  // Choice: nine of ten pairs of depths

using Point = std::array<double, 3>;

// What changes from the pixel before to the one after (x, y) along an axis, in the camera's frame;
// false if neither is known. (x, y) is known, and not at the picture's edge.
bool Slope(const SurfacePicture& picture, int x, int y, int dx, int dy, Point* slope) {
  const int before = picture.Knows(x - dx, y - dy), after = picture.Knows(x + dx, y + dy);
  if (!before && !after) return false;
  Point ends[2];
  for (const int end : {0, 1}) {
    const int steps = end == 0 ? -before : after;
    const int u = x + steps * dx, v = y + steps * dy;
    ends[end] = picture.camera.Unproject(u + 0.5, v + 0.5, picture.depth.at(0, v, u));
  }
  for (int k = 0; k < 3; ++k) (*slope)[k] = ends[1][k] - ends[0][k];
  return true;
}

}  // namespace

std::array<double, 3> SurfacePicture::PointAt(int x, int y) const {
  return camera.WorldFromCam(camera.Unproject(x + 0.5, y + 0.5, depth.at(0, y, x)));
}

float DepthAt(const SurfacePicture& picture, double u, double v) {
  if (!(u >= 0 && v >= 0 && u < picture.camera.width && v < picture.camera.height) ||
      !picture.Knows(static_cast<int>(u), static_cast<int>(v))) {
    return 0;
  }
  const double x = u - 0.5, y = v - 0.5, x0 = std::floor(x), y0 = std::floor(y);
  double sum = 0, weight = 0;
  for (int i = 0; i < 4; ++i) {
    const int px = static_cast<int>(x0) + (i & 1), py = static_cast<int>(y0) + (i >> 1);
    if (px < 0 || py < 0 || px >= picture.camera.width || py >= picture.camera.height) continue;
    const double w = (1 - std::abs(x - px)) * (1 - std::abs(y - py));
    const float depth = picture.depth.at(0, py, px);
    if (!(depth > 0)) continue;
    sum += w * depth;
    weight += w;
  }
  return static_cast<float>(sum / weight);
}

Planes FacingOf(const SurfacePicture& picture) {
  const Camera& camera = picture.camera;
  Planes facing(1, camera.height, camera.width);
  std::fill(facing.data.begin(), facing.data.end(), 1.0f);
  for (int y = 1; y + 1 < camera.height; ++y) {
    for (int x = 1; x + 1 < camera.width; ++x) {
      Point right, down;
      if (!picture.Knows(x, y) || !Slope(picture, x, y, 1, 0, &right) ||
          !Slope(picture, x, y, 0, 1, &down)) {
        continue;
      }
      const Point normal = {right[1] * down[2] - right[2] * down[1],
                            right[2] * down[0] - right[0] * down[2],
                            right[0] * down[1] - right[1] * down[0]};
      const double along = normal[0] * (x + 0.5 - camera.cx) / camera.fx +
                           normal[1] * (y + 0.5 - camera.cy) / camera.fy + normal[2];
      const double length = std::hypot(normal[0], normal[1], normal[2]);
      if (length > 0) facing.at(0, y, x) = static_cast<float>(std::abs(along) / length);
    }
  }
  return facing;
}

MedianPixel MedianPixelOf(const std::vector<SurfacePicture>& pictures,
                          const std::optional<Box>& box) {
  std::vector<float> widths, depths;
  for (const SurfacePicture& picture : pictures) {
    for (int y = 0; y < picture.camera.height; ++y) {
      for (int x = 0; x < picture.camera.width; ++x) {
        if (!picture.Knows(x, y)) continue;
        if (box.has_value() && !box->Holds(picture.PointAt(x, y))) continue;
        widths.push_back(static_cast<float>(picture.WidthAt(x, y)));
        depths.push_back(picture.depth.at(0, y, x));
      }
    }
  }
  return {MedianInPlace(widths), MedianInPlace(depths)};
}

double DepthAgreement(const std::vector<SurfacePicture>& pictures) {
  std::vector<float> differences;
  for (const SurfacePicture& picture : pictures) {
    for (int y = 0; y < picture.camera.height; y += kAgreementStep) {
      for (int x = 0; x < picture.camera.width; x += kAgreementStep) {
        if (!picture.Knows(x, y)) continue;
        const std::array<double, 3> point = picture.PointAt(x, y);
        for (const SurfacePicture& other : pictures) {
          if (&other == &picture) continue;
          const auto p = other.camera.CamFromWorld(point);
          if (!(p[2] > 0)) continue;
          const auto [u, v] = other.camera.Project(p);
          const double depth = DepthAt(other, u, v);
          const double difference = std::abs(depth / p[2] - 1);
          if (difference < kOtherSurface) differences.push_back(static_cast<float>(difference));
        }
      }
    }
  }
  return QuantileInPlace(differences, kAgreementShare);
}

}  // namespace litags
