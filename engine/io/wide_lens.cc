#include "engine/io/wide_lens.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "engine/core/check.h"
#include "engine/core/mask.h"

namespace litags {
namespace {

using std::numbers::pi;

constexpr double kFarthest = 0.75 * pi;  // off the axis: no fisheye sees farther

// A stranger's file may state any size of the whole; training sees 1600 px unless told otherwise.
constexpr double kMostHalf = 2048;  // px

int EvenSide(double half) {
  return std::max(2, 2 * static_cast<int>(std::lround(std::min(half, kMostHalf))));
}

// The direction of the photo's camera that a view's pixel looks along.
std::array<double, 3> Direction(const CubeView& view, int side, int x, int y) {
  const double u = (x + 0.5) / side * 2 - 1, v = (y + 0.5) / side * 2 - 1;  // tangents
  const auto& R = view.R;
  return {R[0] * u + R[1] * v + R[2], R[3] * u + R[4] * v + R[5], R[6] * u + R[7] * v + R[8]};
}

}  // namespace

WideLens PanoramaLens(int width, int height, const PanoramaPart& part) {
  WideLens lens{.width = width, .height = height, .closed = part.whole_width <= width};
  lens.view_side = EvenSide(part.whole_width / (2 * pi));
  lens.seen = [width, height,
               part](const std::array<double, 3>& d) -> std::optional<std::array<double, 2>> {
    const double longitude = std::atan2(d[0], d[2]),
                 down = std::atan2(d[1], std::hypot(d[0], d[2]));
    const double x = part.whole_width * (0.5 + longitude / (2 * pi)) - part.left;
    const double y = part.whole_height * (0.5 + down / pi) - part.top;
    // The whole goes around; a part may go over its edge.
    const double around = x < 0 ? x + part.whole_width : x;
    if (around < 0 || around > width || y < 0 || y > height) return std::nullopt;
    return std::array{around, y};
  };
  return lens;
}

double FisheyeReach(const Camera& camera, const Distortion& lens) {
  const double farthest =
      std::max({camera.cx / camera.fx, (camera.width - camera.cx) / camera.fx,
                camera.cy / camera.fy, (camera.height - camera.cy) / camera.fy});
  return FisheyeAngle(lens, farthest, kFarthest);
}

WideLens FisheyeLens(const Camera& camera, const Distortion& lens, double circle) {
  WideLens wide{.width = camera.width, .height = camera.height};
  const double rim = FisheyeAngle(lens, circle / std::sqrt(camera.fx * camera.fy), kFarthest);
  wide.view_side = EvenSide(std::sqrt(camera.fx * camera.fy));
  wide.seen = [camera, lens,
               rim](const std::array<double, 3>& d) -> std::optional<std::array<double, 2>> {
    const double across = std::hypot(d[0], d[1]), angle = std::atan2(across, d[2]);
    if (angle > rim) return std::nullopt;
    const double scale = across > 0 ? FisheyeRadius(lens, angle) / across : 0;
    const double x = camera.fx * scale * d[0] + camera.cx, y = camera.fy * scale * d[1] + camera.cy;
    if (x < 0 || x > camera.width || y < 0 || y > camera.height) return std::nullopt;
    return std::array{x, y};
  };
  return wide;
}

double SharedBy(const WideLens& lens, const CubeView& view) {
  constexpr int kSteps = 64;
  int seen = 0;
  for (int y = 0; y < kSteps; ++y) {
    for (int x = 0; x < kSteps; ++x) seen += lens.seen(Direction(view, kSteps, x, y)).has_value();
  }
  return static_cast<double>(seen) / (kSteps * kSteps);
}

Photo CutView(const Photo& photo, const WideLens& lens, const CubeView& view) {
  LITAGS_CHECK(photo.width == lens.width && photo.height == lens.height);
  const int side = lens.view_side, width = photo.width, last_row = photo.height - 1;
  const auto column = [&](int x) {
    return lens.closed ? (x + width) % width : std::clamp(x, 0, width - 1);
  };
  Photo out(side, side);
  for (int y = 0; y < side; ++y) {
    for (int x = 0; x < side; ++x) {
      const auto place = lens.seen(Direction(view, side, x, y));
      if (!place.has_value()) continue;
      const double left = std::floor((*place)[0] - 0.5), top = std::floor((*place)[1] - 0.5);
      const auto wx = static_cast<float>((*place)[0] - 0.5 - left);
      const auto wy = static_cast<float>((*place)[1] - 0.5 - top);
      const int x0 = column(static_cast<int>(left)), x1 = column(static_cast<int>(left) + 1);
      const int y0 = std::clamp(static_cast<int>(top), 0, last_row);
      const int y1 = std::clamp(static_cast<int>(top) + 1, 0, last_row);
      for (int c = 0; c < 3; ++c) {
        const float above = photo.pixel(x0, y0)[c] * (1 - wx) + photo.pixel(x1, y0)[c] * wx;
        const float below = photo.pixel(x0, y1)[c] * (1 - wx) + photo.pixel(x1, y1)[c] * wx;
        out.pixel(x, y)[c] = NearestSample(above * (1 - wy) + below * wy);
      }
    }
  }
  return out;
}

PlaneU8 CutMask(const PlaneU8& mask, const WideLens& lens, const CubeView& view) {
  const int side = lens.view_side;
  PlaneU8 out(side, side);
  for (int y = 0; y < side; ++y) {
    for (int x = 0; x < side; ++x) {
      const auto place = lens.seen(Direction(view, side, x, y));
      if (!place.has_value()) continue;
      const int from_x = std::clamp(static_cast<int>((*place)[0]), 0, lens.width - 1);
      const int from_y = std::clamp(static_cast<int>((*place)[1]), 0, lens.height - 1);
      out.data[static_cast<size_t>(y) * side + x] =
          mask.empty() ? kCounts : mask.data[static_cast<size_t>(from_y) * lens.width + from_x];
    }
  }
  return out;
}

}  // namespace litags
