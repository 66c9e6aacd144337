#include "engine/target/lamp_light.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "engine/core/color.h"
#include "engine/target/tone.h"

namespace litags {
namespace {

PointSighting Seen(double x, double y, double lit) {
  PointSighting s;
  s.x = x;
  s.y = y;
  s.lit = lit;
  return s;
}

TEST(LampLight, IsThatOfThePointsAndGoesOnBetweenThem) {
  const LampLight light({Seen(20, 120, 4), Seen(21, 121, 1), Seen(220, 120, 0.5)}, 240, 180);
  EXPECT_NEAR(light.At(25, 125), 2, 1e-6) << "the mean of the logarithms";
  EXPECT_NEAR(light.At(225, 125), 0.5, 1e-6);
  EXPECT_NEAR(light.At(0, 0), 2, 1e-3);
  EXPECT_NEAR(light.At(239, 179), 0.5, 1e-3);
  for (double x = 30, last = 2; x < 220; x += 10) {
    EXPECT_LE(light.At(x, 125), last + 1e-6) << x;
    last = light.At(x, 125);
  }
}

TEST(LampLight, IsOneWithoutPointsAndForOnesOutside) {
  EXPECT_EQ(LampLight({}, 30, 40).At(3, 3), 1);
  EXPECT_EQ(LampLight({Seen(-1, 3, 4), Seen(3, 41, 4)}, 30, 40).At(29.9, 39.9), 1);
  constexpr double kFar = 1e300;  // a point beside the camera
  EXPECT_EQ(LampLight({Seen(kFar, 3, 4), Seen(3, NAN, 4)}, 30, 40).At(3, 3), 1);
}

// Two halves of a photo, one lit four times as much.
TEST(LampLight, CaptureGainIsThatOfTheSceneWithoutTheLamp) {
  Photo even(96, 96), lit(96, 96);
  std::vector<PointSighting> seen;
  for (int y = 0; y < 96; ++y) {
    for (int x = 0; x < 96; ++x) {
      const double light = 0.002 * (1 + (x * 7 + y * 13) % 40), lamp = x < 48 ? 4 : 1;
      for (int c = 0; c < 3; ++c) {
        even.pixel(x, y)[c] = PhotoSample(static_cast<float>(SrgbFromLinear(light)));
        lit.pixel(x, y)[c] = PhotoSample(static_cast<float>(SrgbFromLinear(lamp * light)));
      }
      if (x % 4 == 2 && y % 4 == 2) seen.push_back(Seen(x, y, lamp));
    }
  }
  const std::vector<LampLight> lamps = {LampLight(seen, 96, 96)};
  const double want = CaptureGain({even}, {1.0}, 1),
               have = CaptureGain({lit}, {1.0}, 1, {.lamps = lamps});
  EXPECT_NEAR(std::log2(have / want), 0, 0.02);
  EXPECT_LT(std::log2(CaptureGain({lit}, {1.0}, 1) / want), -0.5);
}

}  // namespace
}  // namespace litags
