#include "engine/io/wide_lens.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "engine/core/mask.h"

namespace litags {
namespace {

constexpr double kInfinite = std::numeric_limits<double>::infinity();

// 180 degrees across 400 px.
Camera Round() {
  const double f = 400 / std::numbers::pi;
  return {.width = 400, .height = 400, .fx = f, .fy = f, .cx = 200, .cy = 200};
}

double Code(const std::array<double, 3>& d) {
  const double length = std::hypot(d[0], d[1], d[2]);
  return 60 + 20 * d[0] / length + 30 * d[1] / length + 10 * d[2] / length;
}

// What the fisheye sees of a world in these codes.
Photo PhotoOf(const Camera& c) {
  Photo photo(c.width, c.height);
  for (int y = 0; y < c.height; ++y) {
    for (int x = 0; x < c.width; ++x) {
      const double u = (x + 0.5 - c.cx) / c.fx, v = (y + 0.5 - c.cy) / c.fy;
      const double t = std::hypot(u, v), s = t > 0 ? std::sin(t) / t : 1;
      const double code = Code({s * u, s * v, std::cos(t)});
      std::fill_n(photo.pixel(x, y), 3, NearestSample(static_cast<float>(code * kPhotoCode)));
    }
  }
  return photo;
}

TEST(WideLens, ViewsOfAFisheyeShowWhatLiesInTheirDirection) {
  const WideLens lens = FisheyeLens(Round(), {.fisheye = true}, 200);
  EXPECT_EQ(lens.view_side, 254);  // 2 f
  const Photo photo = PhotoOf(Round());
  int shown = 0;
  for (const CubeView& view : kCubeViews) {
    const Photo cut = CutView(photo, lens, view);
    const PlaneU8 mask = CutMask(PlaneU8(), lens, view);
    for (const int y : {3, 60, 127, 250}) {
      for (const int x : {3, 60, 127, 250}) {
        if (mask.data[static_cast<size_t>(y) * 254 + x] == 0) continue;
        const double u = (x + 0.5) / 127 - 1, v = (y + 0.5) / 127 - 1;
        const auto& R = view.R;
        EXPECT_NEAR(cut.pixel(x, y)[1] / kPhotoCode,
                    Code({R[0] * u + R[1] * v + R[2], R[3] * u + R[4] * v + R[5],
                          R[6] * u + R[7] * v + R[8]}),
                    0.2)
            << view.name << " " << x << " " << y;
        ++shown;
      }
    }
  }
  EXPECT_EQ(shown, 16 + 4 * 8);  // all of the front, half of its neighbours
}

TEST(WideLens, AViewThatLiesHalfWithinTheCircleIsSharedByHalf) {
  const WideLens lens = FisheyeLens(Round(), {.fisheye = true}, 200);
  EXPECT_EQ(SharedBy(lens, kCubeViews[0]), 1);
  EXPECT_NEAR(SharedBy(lens, kCubeViews[1]), 0.5, 0.01);
  EXPECT_EQ(SharedBy(lens, kCubeViews[2]), 0);
  // Without a circle its picture's corners show what lies behind.
  EXPECT_GT(SharedBy(FisheyeLens(Round(), {.fisheye = true}, kInfinite), kCubeViews[1]), 0.6);
  // 120 degrees of it.
  const WideLens inner = FisheyeLens(Round(), {.fisheye = true}, 200.0 * 2 / 3);
  EXPECT_LT(SharedBy(inner, kCubeViews[1]), 0.3);
  EXPECT_FALSE(inner.seen({std::sin(1.06), 0, std::cos(1.06)}));
  EXPECT_TRUE(inner.seen({std::sin(1.03), 0, std::cos(1.03)}));
}

TEST(WideLens, AFisheyeReachesToItsPicturesSidesOrWhereItsCurveTurns) {
  EXPECT_NEAR(FisheyeReach(Round(), {.fisheye = true}), std::numbers::pi / 2, 1e-6);
  // t - 0.2 t^3 stops rising at the root of 1 / 0.6.
  EXPECT_NEAR(FisheyeReach(Round(), {.k1 = -0.2, .fisheye = true}), std::sqrt(1 / 0.6), 2e-3);
}

}  // namespace
}  // namespace litags
