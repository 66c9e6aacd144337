// What finished pictures are told of a capture's noise.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>

#include "engine/core/rng.h"
#include "engine/io/test_util.h"
#include "engine/pipeline/capture_test_util.h"
#include "engine/pipeline/train_set.h"

namespace litags {
namespace {

// Gives the room photos whose codes `code_of` tells from how far a pixel is to the right, and a
// number of a normal distribution.
void Photograph(const std::function<double(double x, double normal)>& code_of,
                const RoomCapture& room) {
  for (int i = 0; i < room.views(); ++i) {
    ImageU8 photo(RoomCapture::kWidth, RoomCapture::kHeight);
    const CounterRng rng(9, i);
    for (size_t k = 0; k < photo.data.size(); ++k) {
      const double code = code_of(k / 3 % photo.width / double(photo.width), rng.Normal(k));
      photo.data[k] = static_cast<uint8_t>(std::clamp(std::round(code), 0.0, 255.0));
    }
    photo.data[i] ^= 1;  // without noise, too, no two are the same photo
    room.SetPhoto(i, photo);
  }
}

// Codes of noise that the filter expects in pictures of middle grey, of photos of a smooth ramp
// with so much noise.
double NoiseOfPictures(double deviation) {
  const RoomCapture room(4);
  Photograph([=](double x, double normal) { return 96 + 64 * x + deviation * normal; }, room);
  ReconstructOptions options = room.Options(10);
  options.tone = Tone::kNone;
  return 255 * room.Load(options).noise[128];
}

TEST(PictureNoise, IsThatOfRoundingAndAQuarterOfThePhotos) {
  // A target with the photo's own codes is rounded by 1 / sqrt(12) of a code.
  EXPECT_NEAR(NoiseOfPictures(0), 1 / std::sqrt(12.0), 0.01);
  EXPECT_NEAR(NoiseOfPictures(20), 5, 0.5);
}

constexpr double kNoise = 0.002;  // linear light

// Photos of light from black to 0.03, with noise of so much of it.
void PhotographDark(double noise, const RoomCapture& room) {
  Photograph(
      [noise](double x, double normal) {
        const double light = 0.03 * std::max(0.0, x - 0.2) + noise * normal;
        return 255 * SrgbFromLinear(std::max(0.0, light));
      },
      room);
}

TEST(PictureNoise, DarkPicturesOfNoisyPhotosLoseWhatBlackLifts) {
  const RoomCapture room(4);
  PhotographDark(kNoise, room);
  const TrainSet capture = room.Load(room.Options(10));
  ASSERT_TRUE(capture.curve.has_value());
  const CodeCurve& curve = *capture.curve;
  EXPECT_EQ(curve[0], 0);
  EXPECT_TRUE(std::is_sorted(curve.begin(), curve.end()));
  // The targets' black is 0.4 of the noise, brightened as the median, 0.009, is to 0.2.
  const double lifted = 255 * SrgbFromLinear(0.4 * kNoise * 0.2 / 0.009);
  // Noise is told rather low (black_lift_test.cc), so that not all of it becomes black.
  EXPECT_EQ(curve[static_cast<int>(0.5 * lifted)], 0);
  EXPECT_LT(255 * curve[static_cast<int>(lifted)], lifted - 2);
  EXPECT_GT(255 * curve[static_cast<int>(2 * lifted)], 1.9 * lifted);
  EXPECT_NEAR(curve[200], 200 / 255.0, 0.002);
  EXPECT_NEAR(curve[255], 1, 1e-6);
}

TEST(PictureNoise, WithoutNoiseOrWithAnotherToneTheCurveIsNotThere) {
  const RoomCapture room(4);
  ReconstructOptions options = room.Options(10);
  PhotographDark(0, room);
  EXPECT_FALSE(room.Load(options).curve.has_value());
  PhotographDark(kNoise, room);
  options.tone = Tone::kPaper;
  EXPECT_FALSE(room.Load(options).curve.has_value());
}

TEST(PictureNoise, ScenesOfNoisyPhotosHaveTheCurve) {
  const RoomCapture room(4);
  PhotographDark(kNoise, room);
  ReconstructOptions options = room.Options(2);
  const auto curve_in_scene = [&](const std::string& run, const Recipe& recipe) {
    options.recipe = recipe;
    const auto report = Train(room.Input(run), options);
    EXPECT_TRUE(report.ok()) << report.status();
    return Bytes(report->scene_path).find("\"curve\"") != std::string::npos;
  };
  EXPECT_TRUE(curve_in_scene("lita", Litags()));
  EXPECT_FALSE(curve_in_scene("3dgs", Plain3dgs()));
}

// Options that the trainer gets are those that suit the noise: beyond half of what dropout may be,
// noisy photos have all of it.
TEST(PictureNoise, NoisyPhotosRaiseDropoutToItsLimit) {
  const RoomCapture room(4);
  PhotographDark(4 * kNoise, room);
  ReconstructOptions options = room.Options(40);
  const auto scene = [&](const std::string& run, double dropout) {
    options.recipe->dropout = dropout;
    const auto report = Train(room.Input(run), options);
    EXPECT_TRUE(report.ok()) << report.status();
    return Bytes(report->scene_path);
  };
  // Not EXPECT_EQ, which would print the files.
  EXPECT_TRUE(scene("a", 0.7) == scene("b", 0.8));
  EXPECT_FALSE(scene("c", 0.1) == scene("d", 0.2));
}

}  // namespace
}  // namespace litags
