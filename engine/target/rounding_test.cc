#include "engine/target/rounding.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "engine/target/dark_jpeg_test_util.h"

namespace litags {
namespace {

using Ycc = std::array<float, 3>;

struct Errors {
  TestColor rounded = {}, corrected = {};  // means of Y, Cb, Cr against the truth
};

float Distance(const Ycc& a, const Ycc& b) {
  return std::hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]);
}

// Over colours of one ratio, from half a code to five.
Errors ErrorsOf(const RoundingTable& table, const TestColor& ratio) {
  Errors errors;
  constexpr int kColors = 2000;
  for (int i = 0; i < kColors; ++i) {
    const double light = 0.5 * std::pow(10.0, (i + 0.5) / kColors);
    const TestColor rgb = {ratio[0] * light, ratio[1] * light, ratio[2] * light};
    const TestColor truth = TestYcc(rgb), code = TestJpeg(rgb);
    const Ycc add = table.Correction({float(code[0]), float(code[1]), float(code[2])});
    for (int c = 0; c < 3; ++c) {
      errors.rounded[c] += (code[c] - truth[c]) / kColors;
      errors.corrected[c] += (code[c] + add[c] - truth[c]) / kColors;
    }
  }
  return errors;
}

TEST(RoundingTable, WarmShadowsAreNotGreen) {
  const RoundingTable table({.noise = 0.1, .chroma_step = 2});
  const Errors errors = ErrorsOf(table, {1.15, 1, 0.7});
  // Rounding alone takes a fifth of a code of blue away and a tenth of red.
  EXPECT_LT(errors.rounded[1], -0.15);
  EXPECT_LT(errors.rounded[1] + errors.rounded[2], -0.25);
  EXPECT_LT(std::abs(errors.corrected[1]), 0.5 * std::abs(errors.rounded[1]));
  EXPECT_LT(std::abs(errors.corrected[1] + errors.corrected[2]),
            0.5 * std::abs(errors.rounded[1] + errors.rounded[2]));
}

TEST(RoundingTable, TheCapturesColorDecidesWhereCodesSayNothing) {
  const RoundingTable warm({.cb = -0.2, .cr = 0.2, .noise = 0.1, .chroma_step = 2});
  const RoundingTable cold({.cb = 0.2, .cr = -0.2, .noise = 0.1, .chroma_step = 2});
  const Ycc one = {1, 0, 0};
  EXPECT_GT(warm.Correction(one)[2], cold.Correction(one)[2] + 0.05);
  EXPECT_LT(warm.Correction(one)[1], cold.Correction(one)[1] - 0.05);
}

TEST(RoundingTable, ChangesAreSmallAndContinuous) {
  const RoundingTable table({.noise = 0.1, .chroma_step = 2});
  constexpr float kStep = 0.02f;
  for (float y = -1; y < 16; y += 0.07f) {
    for (float cb = -8; cb < 8; cb += 0.83f) {
      for (float cr = -8; cr < 8; cr += 0.79f) {
        const Ycc here = table.Correction({y, cb, cr});
        // Colours of more than three times the luma are outside what the prior knows.
        if (std::max(std::abs(cb), std::abs(cr)) < y) {
          EXPECT_LT(Distance(here, {}), 2) << y;
        }
        EXPECT_LT(Distance(table.Correction({y + kStep, cb, cr}), here), 0.4) << y;
        EXPECT_LT(Distance(table.Correction({y, cb + kStep, cr}), here), 0.4) << y;
      }
    }
  }
  EXPECT_EQ(table.Correction({RoundingTable::kTop, 1, 1}), Ycc{});
  EXPECT_EQ(table.Correction({200, -30, 40}), Ycc{});
}

TEST(RoundingTable, NoiseRoundsEvenly) {
  const RoundingTable noisy({.noise = 2, .jpeg = false});
  for (float y = 5; y < 9; y += 0.25f) {
    EXPECT_LT(Distance(noisy.Correction({y, 0, 0}), {}), 0.15) << y;
  }
}

TEST(RoundingTable, WithoutAJpegGreyStaysGrey) {
  const RoundingTable table({.noise = 0.1, .jpeg = false});
  for (float y = 1; y < 9; ++y) {
    const Ycc add = table.Correction({y, 0, 0});
    EXPECT_NEAR(add[1], 0, 0.05) << y;
    EXPECT_NEAR(add[2], 0, 0.05) << y;
  }
}

}  // namespace
}  // namespace litags
