#include "engine/target/jpeg_chroma.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "engine/target/jpeg_test_util.h"

namespace litags {
namespace {

// Mean error of Cb and Cr over colours whose luma is 0.8 to 4 codes, about grey: as the codes say
// it, and with what was lost.
struct MeanErrors {
  cv::Vec2d codes, mended;
};

MeanErrors ErrorsOf(double deviation) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> luma(0.8, 4);
  std::normal_distribution<double> ratio(0, deviation);
  const JpegChroma chroma({0, 0});
  MeanErrors errors;
  constexpr int kColors = 20000;
  for (int i = 0; i < kColors; ++i) {
    const double y = luma(random), cb = y * ratio(random), cr = y * ratio(random);
    const TestColor rgb = {y + 1.402 * cr, y - 0.344136 * cb - 0.714136 * cr, y + 1.772 * cb};
    if (rgb[0] < 0 || rgb[1] < 0 || rgb[2] < 0) continue;
    const TestColor rounded = TestJpeg(rgb);
    const cv::Vec3f codes(rounded[0], rounded[1], rounded[2]);
    const cv::Vec2d error(codes[1] - cb, codes[2] - cr);
    errors.codes += error / kColors;
    errors.mended += (error + cv::Vec2d(chroma.Lost(codes))) / kColors;
  }
  return errors;
}

// Dark colours come out green: less blue and less red than there was.
TEST(JpegChroma, TakesTheCastOfRoundingAway) {
  for (const double deviation : {0.2, 0.3, 0.4}) {
    const MeanErrors errors = ErrorsOf(deviation);
    for (int c = 0; c < 2; ++c) {
      EXPECT_LT(errors.codes[c], -0.04) << deviation;
      EXPECT_LT(std::abs(errors.mended[c]), 0.5 * std::abs(errors.codes[c])) << deviation;
    }
  }
}

// Y = 1, Cb = -1, Cr = 0 is what R, G, B = 1, 1, 0 become, whose Cb is -0.5; B is 0.25 in the mean.
TEST(JpegChroma, HalfACodeIsGivenBack) {
  const cv::Vec2f lost = JpegChroma({0, 0}).Lost({1, -1, 0});
  EXPECT_GT(lost[0], 0.4);
  EXPECT_LT(lost[0], 0.7);
}

TEST(JpegChroma, IsContinuousAndEndsWhereShadowsDo) {
  const JpegChroma table({0.1f, -0.1f});
  cv::Vec2f before = table.Lost({0, -0.7f, 0.3f});
  for (float y = 0.01f; y < 20; y += 0.01f) {
    const cv::Vec2f now = table.Lost({y, -0.7f, 0.3f});
    EXPECT_LT(cv::norm(now - before), 0.02) << y;
    before = now;
  }
  EXPECT_EQ(before, cv::Vec2f(0, 0));
}

TEST(JpegChroma, AnyCodeHasAFiniteAnswer) {
  const JpegChroma chroma({-4, 4});
  for (const float far : {-1e6f, -300.0f, 300.0f, 1e6f}) {
    for (const float y : {-1e6f, 0.0f, 3.0f, 1e6f}) {
      const cv::Vec2f lost = chroma.Lost({y, far, -far});
      EXPECT_TRUE(std::isfinite(lost[0]) && std::isfinite(lost[1])) << y << " " << far;
    }
  }
}

}  // namespace
}  // namespace litags
