#include "engine/video/frame_choice.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <utility>

#include "engine/core/rng.h"
#include "engine/video/testing_video.h"

namespace litags {
namespace {

using testing::AllOf;
using testing::Ge;
using testing::Le;

// Green as luma, with noise and in any light. There is none below black.
Planes LumaOf(const ImageU8& image, double gain = 1, double noise = 0, uint64_t stream = 0) {
  const CounterRng rng(3, stream);
  Planes luma(1, image.height, image.width);
  for (size_t i = 0; i < image.pixels(); ++i) {
    luma.data[i] = static_cast<float>(
        std::max(0.0, gain * image.data[3 * i + 1] / 255.0 + noise * rng.Normal(i)));
  }
  return luma;
}

std::vector<FrameFacts> Measure(const std::vector<ImageU8>& frames, double gain = 1,
                                double noise = 0) {
  FrameMeter meter;
  std::vector<FrameFacts> facts;
  for (size_t i = 0; i < frames.size(); ++i) {
    facts.push_back(meter.Measure(LumaOf(frames[i], gain, noise, i)));
  }
  return facts;
}

TEST(FrameMeter, MotionIsTheWayOfThePictureAlsoIfItIsSlow) {
  for (const double step : {0.5, 3.0, 12.0}) {  // px a frame
    const auto facts = Measure(WalkFrames(kMeasuredSide, 360, 30, step));
    EXPECT_NEAR(facts.back().motion, 29 * step / kMeasuredSide, 0.15 * 29 * step / kMeasuredSide)
        << step;
  }
}

TEST(FrameMeter, DarkNoisyFramesGiveTheSameMotion) {
  const std::vector<ImageU8> walk = WalkFrames(kMeasuredSide, 360, 20, 4);
  for (const auto& [gain, noise] : {std::pair{0.05, 0.004}, {0.03, 4 / 255.0}}) {
    const auto facts = Measure(walk, gain, noise);
    EXPECT_NEAR(facts.back().motion, 19 * 4.0 / kMeasuredSide, 0.2 * 19 * 4 / kMeasuredSide)
        << gain;
  }
}

TEST(FrameMeter, ACameraThatStandsStillDoesNotMoveForNoise) {
  const std::vector<ImageU8> same(20, WalkFrames(kMeasuredSide, 360, 1, 0)[0]);
  for (const auto& [gain, noise] :
       {std::pair{0.05, 0.004}, {0.03, 4 / 255.0}, {0.005, 4 / 255.0}, {0.0, 4 / 255.0}}) {
    EXPECT_LT(Measure(same, gain, noise).back().motion, 0.01) << gain;
  }
}

TEST(FrameMeter, BlurredFramesAreLessSharp) {
  const auto frames = WalkFrames(kMeasuredSide, 360, 9, 3, {4});
  for (const double gain : {1.0, 0.05}) {
    const auto facts = Measure(frames, gain, 0.002 * gain);
    for (int i = 0; i < 9; ++i) {
      if (i == 4) continue;
      EXPECT_GT(facts[i].sharpness, 1.1 * facts[4].sharpness) << i << " " << gain;
    }
  }
}

std::vector<FrameFacts> Steady(int frames, double way) {
  std::vector<FrameFacts> facts(frames);
  for (int i = 0; i < frames; ++i) facts[i] = {1, way * i / (frames - 1)};
  return facts;
}

TEST(ChooseFrames, TakesAsManyAsMotionAsksForAndNoMoreThanAsked) {
  const auto facts = Steady(1000, 40 * kMotionStep);
  EXPECT_EQ(ChooseFrames(facts, 0).size(), 40u);
  EXPECT_EQ(ChooseFrames(facts, 25).size(), 25u);
  EXPECT_EQ(ChooseFrames(facts, 100).size(), 40u);
  EXPECT_EQ(ChooseFrames(Steady(100'000, 5000 * kMotionStep), 0).size(), size_t{kMostFrames});
  EXPECT_EQ(ChooseFrames(Steady(2, 1), 0).size(), 2u);
  EXPECT_TRUE(ChooseFrames({}, 0).empty());
}

TEST(ChooseFrames, StepsAreEqualInMotionNotInTime) {
  auto facts = Steady(200, 20 * kMotionStep);
  // Stands still for 300 frames in the middle.
  facts.insert(facts.begin() + 100, 300, facts[100]);
  const auto chosen = ChooseFrames(facts, 0);
  const auto in_pause =
      std::count_if(chosen.begin(), chosen.end(), [](int i) { return i > 100 && i < 400; });
  EXPECT_LE(in_pause, 1);
  EXPECT_GE(chosen.size(), 19u);
}

TEST(ChooseFrames, TheSharpestOfItsPartIsTaken) {
  auto facts = Steady(400, 20 * kMotionStep);
  for (int part = 0; part < 20; ++part) facts[20 * part + 9].sharpness = 2;
  const auto chosen = ChooseFrames(facts, 0);
  ASSERT_EQ(chosen.size(), 20u);
  for (int part = 0; part < 20; ++part) EXPECT_EQ(chosen[part], 20 * part + 9);
}

TEST(ChooseFrames, OfACameraThatStandsStillAFewAreTaken) {
  const auto chosen = ChooseFrames(std::vector<FrameFacts>(300, {1, 0}), 0);
  EXPECT_THAT(chosen.size(), AllOf(Ge(10u), Le(size_t{kFewFrames})));
}

}  // namespace
}  // namespace litags
