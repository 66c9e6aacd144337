#include "engine/priors/tone.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "engine/core/error.h"
#include "engine/core/rng.h"

namespace litags {
namespace {

// Codes uniform in [low, high].
ImageU8 MakePhoto(int low, int high) {
  ImageU8 photo(64, 48);
  const CounterRng rng(2, low);
  for (size_t i = 0; i < photo.data.size(); ++i) photo.data[i] = low + rng.Below(i, high - low + 1);
  return photo;
}

double MeanThrough(const ImageU8& photo, const ColorLut& lut) {
  double sum = 0;
  for (size_t i = 0; i < photo.data.size(); ++i) sum += lut[i % 3][photo.data[i]];
  return sum / photo.data.size();
}

TEST(Srgb, EncodingUndoesDecoding) {
  for (int i = 0; i <= 1000; ++i) {
    EXPECT_NEAR(SrgbFromLinear(LinearFromSrgb(i / 1000.0)), i / 1000.0,
                1e-7);  // the standard's own seam
  }
  EXPECT_NEAR(LinearFromSrgb(0.5), 0.2140411, 1e-6);
}

TEST(Tone, PaperGainScalesCodesAndClips) {
  const ImageU8 photo = MakePhoto(2, 40);
  const auto tone = MakeToneCurve(photo, {.rule = ToneRule::kPaperGain, .theta = 0.49});
  ASSERT_TRUE(tone.ok());
  EXPECT_NEAR(tone->mean_before, MeanThrough(photo, IdentityLut()), 1e-6);
  EXPECT_NEAR(tone->gain, 0.49 / tone->mean_before, 1e-9);
  for (int code : {0, 10, 20, 255}) {
    EXPECT_NEAR(tone->lut[1][code], std::min(1.0, tone->gain * code / 255), 1e-6);
  }
}

TEST(Tone, LinearGainBringsTheMeanToTheta) {
  for (const auto& [low, high] : {std::pair{0, 20}, {1, 90}, {150, 255}, {255, 255}}) {
    for (const double theta : {0.2, 0.49, 0.8}) {
      const ImageU8 photo = MakePhoto(low, high);
      const auto tone = MakeToneCurve(photo, {.rule = ToneRule::kLinearGain, .theta = theta});
      ASSERT_TRUE(tone.ok());
      EXPECT_TRUE(tone->reached);
      EXPECT_NEAR(MeanThrough(photo, tone->lut), theta, 1e-5) << low << " " << theta;
      EXPECT_NEAR(tone->mean_after, theta, 1e-6);
    }
  }
}

TEST(Tone, LinearGainIsAGainOfLight) {
  const auto tone = MakeToneCurve(MakePhoto(5, 60), {});
  ASSERT_TRUE(tone.ok());
  for (int code : {3, 17, 42}) {
    const double light = std::min(1.0, tone->gain * LinearFromSrgb(code / 255.0));
    EXPECT_NEAR(tone->lut[0][code], SrgbFromLinear(light), 1e-6);
  }
}

TEST(Tone, CurvesAreMonotoneAndStayInRange) {
  for (const ToneRule rule : {ToneRule::kPaperGain, ToneRule::kLinearGain, ToneRule::kNone}) {
    const auto tone = MakeToneCurve(MakePhoto(0, 30), {.rule = rule});
    ASSERT_TRUE(tone.ok());
    for (const auto& channel : tone->lut) {
      EXPECT_TRUE(std::is_sorted(channel.begin(), channel.end()));
      EXPECT_GE(channel.front(), 0);
      EXPECT_LE(channel.back(), 1);
    }
  }
}

TEST(Tone, NoneLeavesThePhotoAlone) {
  const auto tone = MakeToneCurve(ImageU8(4, 4), {.rule = ToneRule::kNone});
  ASSERT_TRUE(tone.ok());
  EXPECT_EQ(tone->lut, IdentityLut());
}

TEST(Tone, SaysWhenThetaIsOutOfReach) {
  ImageU8 photo(10, 10);
  photo.data[0] = 200;  // all else black: no gain reaches a mean of 0.49
  const auto tone = MakeToneCurve(photo, {});
  ASSERT_TRUE(tone.ok());
  EXPECT_FALSE(tone->reached);
  EXPECT_NEAR(tone->mean_after, 1 / 300.0, 1e-6);
  EXPECT_TRUE(MakeToneCurve(MakePhoto(5, 60), {})->reached);
}

TEST(Tone, BlackAndEmptyPhotosAndBadOptionsAreErrors) {
  EXPECT_EQ(GetErrorDetail(MakeToneCurve(ImageU8(4, 4), {}).status())->reason, "BLACK_IMAGE");
  EXPECT_EQ(GetErrorDetail(MakeToneCurve(ImageU8(), {}).status())->reason, "EMPTY_IMAGE");
  for (const double theta : {0.0, 1.0, -1.0, double(NAN)}) {
    EXPECT_EQ(GetErrorDetail(MakeToneCurve(MakePhoto(1, 9), {.theta = theta}).status())->field,
              "tone.theta");
  }
}

}  // namespace
}  // namespace litags
