#include "engine/eval/flicker.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "engine/core/error.h"

namespace litags {
namespace {

constexpr double kDepthTolerance = 0.02;  // relative

bool Fits(const PathFrame& frame) {
  const auto fits = [&](const Planes& planes, int channels) {
    return planes.channels == channels && planes.width == frame.camera.width &&
           planes.height == frame.camera.height;
  };
  return fits(frame.color, 3) && fits(frame.depth, 1);
}

// Where the pixel (x, y) of `to` lies in `from`, px and depth there.
struct Place {
  double x, y, z;
};

Place PlaceIn(const Camera& from, const Camera& to, double x, double y, double depth) {
  const auto p = from.CamFromWorld(to.WorldFromCam(to.Unproject(x, y, depth)));
  const auto [u, v] = from.Project(p);
  return {u, v, p[2]};
}

std::array<double, 4> CatmullRomWeights(double u) {
  const double u2 = u * u, u3 = u2 * u;
  return {0.5 * (-u + 2 * u2 - u3), 0.5 * (2 - 5 * u2 + 3 * u3), 0.5 * (u + 4 * u2 - 3 * u3),
          0.5 * (u3 - u2)};
}

// Whether every pixel of `frame` that interpolation at this place needs is inside and has its
// depth; (x, y) is the upper left of the four around it.
bool Visible(const PathFrame& frame, const Place& at, int* x, int* y) {
  if (!(at.z > 0)) return false;
  const double fx = std::floor(at.x - 0.5), fy = std::floor(at.y - 0.5);
  if (!(fx >= 1 && fy >= 1 && fx + 2 < frame.camera.width && fy + 2 < frame.camera.height)) {
    return false;
  }
  *x = static_cast<int>(fx);
  *y = static_cast<int>(fy);
  for (int k = 0; k < 16; ++k) {
    const float z = frame.depth.at(0, *y - 1 + k / 4, *x - 1 + k % 4);
    if (!(std::abs(z - at.z) <= kDepthTolerance * at.z)) return false;
  }
  return true;
}

double Interpolate(const Planes& image, int c, int x, int y, const std::array<double, 4>& wx,
                   const std::array<double, 4>& wy) {
  double sum = 0;
  for (int j = 0; j < 4; ++j) {
    for (int i = 0; i < 4; ++i) sum += wy[j] * wx[i] * image.at(c, y - 1 + j, x - 1 + i);
  }
  return std::clamp(sum, 0.0, 1.0);  // steep edges overshoot
}

}  // namespace

void Flicker::Add(const Flicker& step) {
  difference += step.difference;
  compared += step.compared;
  pixels += step.pixels;
}

absl::StatusOr<Flicker> MeasureFlicker(const PathFrame& from, const PathFrame& to) {
  if (!Fits(from) || !Fits(to)) {
    return InvalidInput("SIZE_MISMATCH", "frame",
                        "frame: colour, depth and camera of a frame must have one size");
  }
  Flicker flicker;
  flicker.pixels = static_cast<int64_t>(to.depth.plane_size());
  for (int y = 0; y < to.camera.height; ++y) {
    for (int x = 0; x < to.camera.width; ++x) {
      const float depth = to.depth.at(0, y, x);
      if (!(depth > 0)) continue;
      const Place at = PlaceIn(from.camera, to.camera, x + 0.5, y + 0.5, depth);
      int left, top;
      if (!Visible(from, at, &left, &top)) continue;
      const auto wx = CatmullRomWeights(at.x - 0.5 - left),
                 wy = CatmullRomWeights(at.y - 0.5 - top);
      for (int c = 0; c < 3; ++c) {
        flicker.difference +=
            std::abs(Interpolate(from.color, c, left, top, wx, wy) - to.color.at(c, y, x)) / 3;
      }
      ++flicker.compared;
    }
  }
  return flicker;
}

}  // namespace litags
