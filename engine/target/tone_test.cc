#include "engine/target/tone.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <utility>
#include <vector>

#include "engine/core/color.h"
#include "engine/core/error.h"
#include "engine/core/rng.h"
#include "engine/target/response.h"

namespace litags {
namespace {

// Codes uniform in [low, high].
ImageU8 MakePhoto(int low, int high) {
  ImageU8 photo(64, 48);
  const CounterRng rng(2, low);
  for (size_t i = 0; i < photo.data.size(); ++i) photo.data[i] = low + rng.Below(i, high - low + 1);
  return photo;
}

double MeanCode(const ImageU8& photo) {
  return std::accumulate(photo.data.begin(), photo.data.end(), 0.0) / (255 * photo.data.size());
}

absl::StatusOr<ToneTarget> MakeTarget(const ImageU8& photo, const ToneOptions& options) {
  const std::vector<Photo> photos = {PhotoFromU8(photo)};
  const std::vector<double> exposures = {1.0};
  LITAGS_ASSIGN_OR_RETURN(std::vector<ToneTarget> targets,
                          MakeTargets(photos, exposures, options, 1));
  return std::move(targets[0]);
}

// The code that `code` becomes: of the first sample that has it.
int Through(const ImageU8& photo, const Photo& target, int code) {
  const auto at = std::find(photo.data.begin(), photo.data.end(), code);
  EXPECT_NE(at, photo.data.end()) << code;
  return PhotoToU8(target).data[at - photo.data.begin()];
}

TEST(Srgb, EncodingUndoesDecoding) {
  for (int i = 0; i <= 1000; ++i) {
    EXPECT_NEAR(SrgbFromLinear(LinearFromSrgb(i / 1000.0)), i / 1000.0,
                1e-7);  // the standard's own seam
  }
  EXPECT_NEAR(LinearFromSrgb(0.5), 0.2140411, 1e-6);
}

TEST(Tone, EachTargetMadeIsReported) {
  const std::vector<Photo> photos(3, PhotoFromU8(MakePhoto(2, 40)));
  for (const Tone rule : {Tone::kPaper, Tone::kCapture, Tone::kNone}) {
    int done = 0;
    ASSERT_TRUE(MakeTargets(photos, {1, 1, 1}, {.rule = rule}, 1, {}, [&](int) { ++done; }).ok());
    EXPECT_EQ(done, 3);
  }
}

TEST(Tone, ACancelIsHeardBeforeTheNextTarget) {
  const std::vector<Photo> photos(3, PhotoFromU8(MakePhoto(2, 40)));
  for (const Tone rule : {Tone::kPaper, Tone::kCapture, Tone::kNone}) {
    CancelToken cancel;
    int done = 0;
    const auto on_done = [&](int) {
      ++done;
      cancel.Cancel();
    };
    const absl::Status status =
        MakeTargets(photos, {1, 1, 1}, {.rule = rule}, 1, {}, on_done, cancel).status();
    EXPECT_EQ(status.code(), absl::StatusCode::kCancelled) << status;
    EXPECT_EQ(done, 1);
  }
}

TEST(Tone, PaperGainScalesCodesAndClips) {
  const ImageU8 photo = MakePhoto(2, 40);
  const auto target = MakeTarget(photo, {.rule = Tone::kPaper});
  ASSERT_TRUE(target.ok());
  EXPECT_NEAR(target->gain, 0.49 / MeanCode(photo), 1e-9);  // the release's theta by default
  for (const int code : {2, 10, 20, 40}) {
    EXPECT_EQ(Through(photo, target->image, code),
              std::lround(255 * std::min(1.0, target->gain * code / 255)));
  }
}

TEST(Tone, CaptureGainIgnoresLampsThatMoveTheMean) {
  ImageU8 plain = MakePhoto(1, 12), lamps = plain;
  std::fill(lamps.data.begin(), lamps.data.begin() + lamps.data.size() / 16, 250);
  const std::vector<double> exposures = {1.0};
  const auto gain = [&](const ImageU8& photo) {
    return CaptureGain({PhotoFromU8(photo)}, exposures, 1);
  };
  const ToneOptions paper{.rule = Tone::kPaper};
  EXPECT_NEAR(std::log2(gain(lamps) / gain(plain)), 0, 0.4);
  EXPECT_LT(std::log2(MakeTarget(lamps, paper)->gain / MakeTarget(plain, paper)->gain), -1);
}

TEST(Tone, CaptureGainKeepsWhatDiffersBetweenPhotos) {
  // The same light, once with much of it in view and once with little: one gain for both.
  const std::vector<Photo> photos = {PhotoFromU8(MakePhoto(2, 20)), PhotoFromU8(MakePhoto(20, 40))};
  const std::vector<double> same = {1, 1}, twice = {1, 2};
  const auto targets = MakeTargets(photos, same, {}, 2);
  ASSERT_TRUE(targets.ok());
  EXPECT_EQ((*targets)[0].gain, (*targets)[1].gain);
  // The second photo was exposed twice as long: half the gain.
  const auto evened = MakeTargets(photos, twice, {}, 2);
  ASSERT_TRUE(evened.ok());
  EXPECT_NEAR((*evened)[0].gain / (*evened)[1].gain, 2, 1e-9);
}

TEST(Tone, WhatATorchLightsIsExposedForHoweverLittleItIs) {
  const ImageU8 lit = MakePhoto(10, 90);
  const std::vector<double> exposures = {1.0};
  const double gain = CaptureGain({PhotoFromU8(lit)}, exposures, 1);
  for (const double share : {0.05, 0.5, 0.6, 0.95}) {
    // The lit photo, and no light below it.
    ImageU8 torch(lit.width, static_cast<int>(lit.height / (1 - share)));
    std::copy(lit.data.begin(), lit.data.end(), torch.data.begin());
    EXPECT_NEAR(CaptureGain({PhotoFromU8(torch)}, exposures, 1) / gain, 1, 0.25) << share;
    // Black is where the sensor's noise ends.
    for (const double noise : {0.5, 1.0, 2.0}) {
      ImageU8 noisy = torch;
      const CounterRng rng(1, 0);
      for (size_t i = lit.data.size(); i < noisy.data.size(); ++i) {
        noisy.data[i] = static_cast<uint8_t>(std::lround(std::max(0.0, noise * rng.Normal(i))));
      }
      EXPECT_NEAR(CaptureGain({PhotoFromU8(noisy)}, exposures, 1) / gain, 1, 0.25)
          << share << ", noise " << noise;
    }
  }
}

// The shadows of an ordinary dark photo are not noise, though they are no brighter than it.
TEST(Tone, NoiseOfADarkPhotoHardlyChangesItsExposure) {
  constexpr int kWidth = 480, kHeight = 320, kCell = 5;
  constexpr double kFullWell = 15000, kReadNoise = 4, kStops = 9;  // electrons
  const CounterRng texture(1, 0), noise(1, 1);
  Photo fine(kWidth, kHeight);
  ImageU8 dark(kWidth, kHeight);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      // Bright and dark areas, with texture.
      const int area = y / 80 * 6 + x / 80, cell = y / kCell * (kWidth / kCell) + x / kCell;
      const double stops = -6 * texture.Uniform(area) + texture.Normal(1000 + cell) / 2;
      const double light = std::exp2(std::min(stops, 0.0) - kStops), electrons = kFullWell * light;
      for (int c = 0; c < 3; ++c) {
        const size_t i = 3 * (size_t(y) * kWidth + x) + c;
        const double seen =
            electrons + std::hypot(kReadNoise, std::sqrt(electrons)) * noise.Normal(i);
        fine.data[i] = PhotoSample(static_cast<float>(SrgbFromLinear(light)));
        dark.data[i] = static_cast<uint8_t>(
            std::lround(255 * SrgbFromLinear(std::clamp(seen / kFullWell, 0.0, 1.0))));
      }
    }
  }
  const std::vector<double> exposures = {1.0};
  EXPECT_NEAR(std::log2(CaptureGain({PhotoFromU8(dark)}, exposures, 1)),
              std::log2(CaptureGain({fine}, exposures, 1)), 0.3);
}

// Photos that are noise all over are brightened all the same.
TEST(Tone, WhatNoiseHidesDecidesWhereNothingElseIsSeen) {
  ImageU8 hidden(200, 100);
  const CounterRng rng(1, 0);
  for (size_t i = 0; i < hidden.data.size(); ++i) {
    hidden.data[i] = static_cast<uint8_t>(std::lround(std::max(0.0, 0.3 + rng.Normal(i))));
  }
  EXPECT_GT(CaptureGain({PhotoFromU8(hidden)}, std::vector<double>{1.0}, 1), 100);
}

TEST(Tone, ClippedChannelsTakeTheColorThatAnotherPhotoShows) {
  // Wood, on the brighter photo with red and green clipped.
  const double light[3] = {0.8, 0.36, 0.11};
  const auto photo_of = [&](double exposure) {
    ImageU8 photo(64, 48);
    for (size_t i = 0; i < photo.data.size(); ++i) {
      photo.data[i] = std::lround(255 * SrgbFromLinear(std::min(1.0, exposure * light[i % 3])));
    }
    return photo;
  };
  const ImageU8 brighter = photo_of(4);
  ASSERT_EQ(brighter.data[0], 255);
  ASSERT_EQ(brighter.data[1], 255);
  const std::vector<Photo> photos = {PhotoFromU8(brighter), PhotoFromU8(photo_of(1))};
  const std::vector<double> exposures = {4, 1};
  const auto together = MakeTargets(photos, exposures, {}, 1);
  ASSERT_TRUE(together.ok());
  const std::vector<uint8_t> bright = PhotoToU8((*together)[0].image).data,
                             dark = PhotoToU8((*together)[1].image).data;
  for (int c = 0; c < 3; ++c) EXPECT_NEAR(bright[c], dark[c], 4) << c;
  EXPECT_GT(bright[0], bright[1] + 40);

  const auto alone = MakeTarget(brighter, {});
  ASSERT_TRUE(alone.ok());
  EXPECT_EQ(alone->image.data[0], alone->image.data[1]);
}

// An over-exposed wall with a window, and the dark corners of a lens evened out.
TEST(Tone, WhatTheCameraDidNotClipIsNotTakenForWhiteWhereItWasBrightened) {
  constexpr int kWidth = 96, kHeight = 72;
  const RadialFrame frame = {kWidth / 2.0, kHeight / 2.0, std::hypot(kWidth, kHeight) / 2.0};
  const Vignette vignette = {-0.8, 0, 0};
  const std::array<double, 3> gain = {1, 1, 0.9};
  ImageU8 stored(kWidth, kHeight);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const bool window = x > 40 && x < 56 && y > 20 && y < 50;
      for (int c = 0; c < 3; ++c) stored.pixel(x, y)[c] = window ? 255 : 217 - 10 * c;
    }
  }
  Photo photo = PhotoFromU8(stored);
  ApplyResponse(gain, vignette, frame, &photo);
  const Photo evened = photo;
  ASSERT_GT(photo.pixel(0, 0)[0] / kPhotoCode, 270);
  const std::vector<Brightening> brightened = {Brightening(gain, vignette, frame)};
  const std::vector<double> exposures = {1.0};
  const auto targets =
      MakeTargets({photo}, exposures, {.contrast = 0}, 1, {.brightened = brightened});
  ASSERT_TRUE(targets.ok()) << targets.status();
  const double by = targets->front().gain;
  ASSERT_LT(by, 0.7);
  const ImageU8 target = PhotoToU8(targets->front().image);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      if (x > 30 && x < 66 && y > 10 && y < 60) continue;  // codes are smoothed at the window
      for (int c = 0; c < 3; ++c) {
        const double light = by * LinearTable::Get()(evened.pixel(x, y)[c]);
        ASSERT_NEAR(target.pixel(x, y)[c], 255 * SrgbFromLinear(std::min(1.0, light)), 3)
            << x << " " << y << " " << c;
      }
    }
  }
  EXPECT_GT(target.pixel(48, 35)[1], 255 * SrgbFromLinear(by) + 10) << "the window is filled";
}

TEST(Brightening, UndoesWhatMadeAPhotoBrighter) {
  const RadialFrame frame = {20, 15, 25};
  const std::array<double, 3> gain = {0.7, 1, 1.2};
  const Vignette vignette = {-1, -0.5, 0};
  const Photo stored = PhotoFromU8(MakePhoto(0, 255));
  Photo photo = stored;
  ApplyResponse(gain, vignette, frame, &photo);
  const Brightening brightened(gain, vignette, frame);
  EXPECT_FALSE(brightened.none());
  EXPECT_TRUE(Brightening({1, 1, 1.2}, {}, frame).none());
  const Photo undone = brightened.Undone(photo);
  for (int y = 0; y < photo.height; ++y) {
    for (int x = 0; x < photo.width; ++x) {
      const auto grew = brightened.At(x, y);
      for (int c = 0; c < 3; ++c) {
        const int16_t was = stored.pixel(x, y)[c];
        if (photo.pixel(x, y)[c] == 32767) {
          EXPECT_EQ(undone.pixel(x, y)[c], kPhotoWhite);
        } else if (grew[c] > 1) {
          ASSERT_NEAR(undone.pixel(x, y)[c], was, 4) << x << " " << y << " " << c;
        } else {
          ASSERT_EQ(undone.pixel(x, y)[c], photo.pixel(x, y)[c]);
        }
      }
    }
  }
}

TEST(Tone, TargetsGrowWithThePhoto) {
  ImageU8 ramp(86, 1);
  for (size_t i = 0; i < ramp.data.size(); ++i) ramp.data[i] = static_cast<uint8_t>(i);
  for (const Tone rule : {Tone::kPaper, Tone::kNone}) {
    const auto target = MakeTarget(ramp, {.rule = rule});
    ASSERT_TRUE(target.ok());
    EXPECT_TRUE(std::is_sorted(target->image.data.begin(), target->image.data.begin() + 256));
  }
  // Without clipped samples there is nothing to fill in: a curve alone.
  for (size_t i = 0; i < ramp.data.size(); ++i) ramp.data[i] = std::min<uint8_t>(i, 253);
  const auto target = MakeTarget(ramp, {});
  ASSERT_TRUE(target.ok());
  EXPECT_TRUE(std::is_sorted(target->image.data.begin(), target->image.data.begin() + 255));
}

TEST(Tone, NoneLeavesThePhotoAlone) {
  const auto black = MakeTarget(ImageU8(4, 4), {.rule = Tone::kNone});
  ASSERT_TRUE(black.ok());
  EXPECT_EQ(black->image.data, Photo(4, 4).data);
  Photo fine(4, 4);  // a few samples around black: less than a code
  for (size_t i = 0; i < fine.data.size(); ++i) fine.data[i] = static_cast<int16_t>(i % 7) - 3;
  const auto targets = MakeTargets({fine}, {1.0}, {.rule = Tone::kNone}, 1);
  ASSERT_TRUE(targets.ok());
  EXPECT_EQ((*targets)[0].image.data, fine.data);
}

TEST(Tone, SaysWhenTheGoalIsOutOfReach) {
  const ImageU8 photo = MakePhoto(5, 60);
  const auto target = MakeTarget(photo, {.max_gain = 2});
  ASSERT_TRUE(target.ok());
  EXPECT_FALSE(target->reached);
  EXPECT_LE(target->gain, 2);
  EXPECT_TRUE(MakeTarget(photo, {})->reached);
}

TEST(Tone, RoundingNoiseIsTheStepBetweenCodes) {
  const double root = std::sqrt(12.0);
  // The identity steps by one code, the paper's gain by as many as it says, until it clips.
  const auto none = RoundingNoise({.rule = Tone::kNone}, 1);
  const auto paper = RoundingNoise({.rule = Tone::kPaper}, 10);
  for (const int code : {0, 100, 200, 255}) EXPECT_NEAR(255 * none[code], 1 / root, 1e-4) << code;
  for (const int code : {0, 100, 240}) EXPECT_NEAR(255 * paper[code], 10 / root, 1e-4) << code;

  // A photo's codes 3 and 4, both in the linear foot of sRGB, after 6 stops without contrast.
  const ToneOptions plain{.contrast = 0};
  const auto target = [](double code) {
    return 255 * SrgbFromLinear(64 * LinearFromSrgb(code / 255));
  };
  const auto dark = RoundingNoise(plain, 64);
  EXPECT_NEAR(255 * dark[std::lround(target(3.5))], (target(4) - target(3)) / root, 0.05);
  // Nothing is darker than code 0: there half a code is the step.
  EXPECT_NEAR(255 * dark[0], 2 * target(0.5) / root, 0.05);
  for (const int code : {40, 80, 120, 160}) EXPECT_LT(dark[code], dark[code - 40]) << code;

  const auto deep = RoundingNoise(plain, 64, 1.0 / 257);  // 16 bits
  for (const int code : {0, 60, 200}) EXPECT_NEAR(257 * deep[code], dark[code], 1e-6) << code;

  const auto glare = RoundingNoise({}, 0.25);
  EXPECT_LT(255 * *std::max_element(glare.begin(), glare.end()), 0.5);
}

TEST(Tone, IsTheSameForAnyNumberOfThreads) {
  std::vector<Photo> photos;
  for (const auto& [low, high] : {std::pair{0, 255}, {200, 255}, {3, 90}}) {
    photos.push_back(PhotoFromU8(MakePhoto(low, high)));
  }
  const std::vector<double> exposures = {1, 2, 0.5};
  const auto one = MakeTargets(photos, exposures, {}, 1),
             two = MakeTargets(photos, exposures, {}, 2);
  ASSERT_TRUE(one.ok() && two.ok());
  for (int i = 0; i < 3; ++i) EXPECT_EQ((*one)[i].image.data, (*two)[i].image.data);
}

TEST(Tone, BlackAndEmptyPhotosAndBadOptionsAreErrors) {
  EXPECT_EQ(GetErrorDetail(MakeTarget(ImageU8(4, 4), {}).status())->reason, "BLACK_IMAGE");
  // Of a 16-bit file: light, but less than half a code, of which the paper's rule works.
  Photo faint(4, 4);
  std::fill(faint.data.begin(), faint.data.end(), static_cast<int16_t>(kPhotoCode / 3));
  const double one = 1;
  ToneOptions paper;
  paper.rule = Tone::kPaper;
  EXPECT_EQ(GetErrorDetail(MakeTargets({&faint, 1}, {&one, 1}, paper, 1, {}).status())->reason,
            "BLACK_IMAGE");
  EXPECT_EQ(GetErrorDetail(MakeTarget(ImageU8(), {}).status())->reason, "EMPTY_IMAGE");
  const ImageU8 photo = MakePhoto(1, 9);
  for (const double theta : {1.0, -1.0, double(NAN)}) {
    EXPECT_EQ(GetErrorDetail(MakeTarget(photo, {.theta = theta}).status())->field, "theta");
  }
  for (const double contrast : {-0.1, 1.1, double(NAN)}) {
    EXPECT_EQ(GetErrorDetail(MakeTarget(photo, {.contrast = contrast}).status())->field,
              "contrast");
  }
}

}  // namespace
}  // namespace litags
