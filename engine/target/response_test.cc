#include "engine/target/response.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "engine/core/mask.h"
#include "engine/core/rng.h"

namespace litags {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr Vignette kNone = {0, 0, 0};
const double kStop = std::log(2.0);

// Photos on a path: photo i sees points [step i, step i + view).
struct World {
  int photos = 20, step = 20, view = 200;
  double noise = 0;  // standard deviation of a channel's log light
  double wrong = 0;  // share of samples of something else
  double most_radius = 1;
  Vignette vignette = kNone;
  double lamp = 0;                           // power of the distance
  double farthest = 4;                       // distance; the nearest is 1
  std::vector<std::array<double, 3>> gains;  // logs; empty: 0
  int seed = 1;
};

double Normal(const CounterRng& rng, uint64_t i) {
  return std::sqrt(-2 * std::log(1 - rng.Uniform(2 * i))) *
         std::cos(2 * 3.14159265358979 * rng.Uniform(2 * i + 1));
}

std::vector<PointSample> Samples(const World& w) {
  const CounterRng albedo(w.seed, 1), place(w.seed, 2), noise(w.seed, 3), wrong(w.seed, 4),
      away(w.seed, 5);
  std::vector<PointSample> samples;
  for (int point = 0; point < w.step * w.photos + w.view; ++point) {
    for (int i = 0; i < w.photos; ++i) {
      if (point < w.step * i || point >= w.step * i + w.view) continue;
      const uint64_t id = samples.size();
      PointSample s{point, i, w.most_radius * std::sqrt(place.Uniform(id)), {}};
      s.log_distance = std::log(w.farthest) * away.Uniform(id);
      for (int c = 0; c < 3; ++c) {
        s.log_light[c] = std::log(0.02 + 0.3 * albedo.Uniform(3 * point + c));
        if (!w.gains.empty()) s.log_light[c] += w.gains[i][c];
        s.log_light[c] += LogVignette(w.vignette, s.radius) - w.lamp * s.log_distance;
        s.log_light[c] += w.noise * Normal(noise, 3 * id + c);
        if (wrong.Uniform(4 * id) < w.wrong) s.log_light[c] = -4 * wrong.Uniform(4 * id + 1 + c);
      }
      samples.push_back(s);
    }
  }
  return samples;
}

// Uniform within +-most, red and blue; every photo has an exposure, too.
std::vector<std::array<double, 3>> Jitter(int photos, double most) {
  const CounterRng rng(9, 9);
  std::vector<std::array<double, 3>> gains;
  for (int i = 0; i < photos; ++i) {
    const double exposure = rng.Uniform(3 * i) - 0.5;
    gains.push_back({exposure + most * (2 * rng.Uniform(3 * i + 1) - 1), exposure,
                     exposure + most * (2 * rng.Uniform(3 * i + 2) - 1)});
  }
  return gains;
}

double MedianLog(const CaptureResponse& response, int channel) {
  std::vector<double> logs;
  for (const auto& gain : response.gains) logs.push_back(std::log(gain[channel]));
  std::sort(logs.begin(), logs.end());
  return logs[logs.size() / 2];
}

// Largest error of a log gain of red and blue relative to green, medians aside.
double WorstGain(const CaptureResponse& have, const std::vector<std::array<double, 3>>& logs) {
  double worst = 0;
  for (const int c : {0, 2}) {
    std::vector<double> errors;
    for (size_t i = 0; i < logs.size(); ++i)
      errors.push_back(std::log(have.gains[i][c]) - (logs[i][c] - logs[i][1]));
    std::vector<double> sorted = errors;
    std::sort(sorted.begin(), sorted.end());
    for (const double e : errors) worst = std::max(worst, std::abs(e - sorted[sorted.size() / 2]));
  }
  return worst;
}

double WorstVignette(const Vignette& have, const Vignette& want) {
  double worst = 0;
  for (double r = 0; r <= 1; r += 0.05)
    worst = std::max(worst, std::abs(LogVignette(have, r) - LogVignette(want, r)));
  return worst / kStop;
}

void ExpectNothing(const CaptureResponse& response, size_t photos) {
  EXPECT_EQ(response.vignette, kNone);
  EXPECT_EQ(response.lamp_power, 0);
  ASSERT_EQ(response.gains.size(), photos);
  for (const auto& gain : response.gains) EXPECT_THAT(gain, ElementsAre(1, 1, 1));
}

TEST(Response, FindsWhiteBalancesAndVignette) {
  World w;
  w.gains = Jitter(w.photos, 0.35);
  w.vignette = {-0.5, -0.4, -0.6};
  const CaptureResponse have = EstimateResponse(w.photos, Samples(w));
  // Gains are drawn to 1 as by one sample in 200.
  EXPECT_LT(WorstGain(have, w.gains), 0.01);
  // The profile is drawn to a straight slope.
  EXPECT_LT(WorstVignette(have.vignette, w.vignette), 0.05);
}

TEST(Response, NoiseAndWrongMatchesHardlyMatter) {
  World w;
  w.gains = Jitter(w.photos, 0.35);
  w.vignette = {-1.73, 0, 0};  // 2.5 stops
  w.noise = 0.07;
  w.wrong = 0.2;
  const CaptureResponse have = EstimateResponse(w.photos, Samples(w));
  EXPECT_LT(WorstGain(have, w.gains), 0.04);
  EXPECT_LT(WorstVignette(have.vignette, w.vignette), 0.15);
}

TEST(Response, FindsALampBesideWhatItsBeamLeavesDark) {
  for (const double power : {0.8, 1.6, 2.0}) {
    World w;
    w.gains = Jitter(w.photos, 0.1);
    w.vignette = {-1.0, -0.4, 0};
    w.lamp = power;
    w.noise = 0.07;
    w.wrong = 0.2;
    const CaptureResponse have = EstimateResponse(w.photos, Samples(w));
    EXPECT_NEAR(have.lamp_power, power, 0.03);
    EXPECT_NEAR(have.lamp_distance, 2, 0.1);
    EXPECT_LT(WorstVignette(have.vignette, w.vignette), 0.15);
  }
}

TEST(Response, LightFallsWithTheSquareOfTheDistanceAtMost) {
  World w;
  w.lamp = 3;
  EXPECT_EQ(EstimateResponse(w.photos, Samples(w)).lamp_power, kMostLamp);
}

TEST(Response, ALampThatHardlyDarkensOnceItsPowerIsBoundedIsNone) {
  World w;
  w.lamp = 4;
  w.farthest = 1.45;  // from the nearest to the farthest tenth 1.7 stops; a power of 2 has 0.9
  EXPECT_EQ(EstimateResponse(w.photos, Samples(w)).lamp_power, 0);
}

TEST(Response, ALampThatHardlyDarkensIsNone) {
  World w;
  w.lamp = 0.2;  // 0.3 stops from the nearest to the farthest tenth
  ExpectNothing(EstimateResponse(w.photos, Samples(w)), w.photos);
}

TEST(Response, WhereNothingIsNothingIsFound) {
  for (int seed = 1; seed <= 10; ++seed) {
    World w;
    w.seed = seed;
    w.noise = 0.1;
    w.wrong = 0.1;
    w.gains = Jitter(w.photos, 0);  // exposures alone
    ExpectNothing(EstimateResponse(w.photos, Samples(w)), w.photos);
  }
}

TEST(Response, FewPointsShowLittle) {
  for (int seed = 1; seed <= 10; ++seed) {
    World w;
    w.seed = seed;
    w.step = 5, w.view = 25;
    w.noise = 0.15;
    const CaptureResponse have = EstimateResponse(w.photos, Samples(w));
    EXPECT_EQ(have.vignette, kNone) << seed;
    ASSERT_EQ(have.gains.size(), size_t(w.photos));
    for (const auto& gain : have.gains) {
      EXPECT_NEAR(std::log(gain[0]), 0, 0.1) << seed;
      EXPECT_NEAR(std::log(gain[2]), 0, 0.1) << seed;
    }
  }
}

TEST(Response, APhotoWithTooFewSamplesKeepsItsWhiteBalance) {
  World w;
  w.gains = Jitter(w.photos, 0.35);
  std::vector<PointSample> samples = Samples(w), kept;
  int of_photo_3 = 0;
  for (const PointSample& s : samples) {
    if (s.photo != 3 || of_photo_3++ < kMinSightings - 1) kept.push_back(s);
  }
  const CaptureResponse have = EstimateResponse(w.photos, kept);
  EXPECT_THAT(have.gains[3], ElementsAre(1, 1, 1));
  EXPECT_GT(std::abs(std::log(have.gains[4][0])), 0.001);
}

TEST(Response, TheMedianPhotoKeepsItsWhiteBalance) {
  World w;
  w.photos = 21;
  w.gains = Jitter(w.photos, 0.35);
  for (auto& gain : w.gains) gain[0] += 1;  // a cast of all is nobody's difference
  const CaptureResponse have = EstimateResponse(w.photos, Samples(w));
  for (const int c : {0, 1, 2}) EXPECT_NEAR(MedianLog(have, c), 0, 1e-12);
}

TEST(Response, OnePhotoOrNoneHasNothingToDifferFrom) {
  World w;
  w.photos = 1;
  w.vignette = {-2, 0, 0};
  ExpectNothing(EstimateResponse(1, Samples(w)), 1);
  ExpectNothing(EstimateResponse(0, {}), 0);
  ExpectNothing(EstimateResponse(3, {}), 3);
}

TEST(Response, RadiiThatAreAllAlikeTellNoVignette) {
  World w;
  w.noise = 0.05;
  std::vector<PointSample> samples = Samples(w);
  for (PointSample& s : samples) s.radius = 0.5;
  ExpectNothing(EstimateResponse(w.photos, samples), w.photos);
}

TEST(Response, SamplesAllAlikeAreNoTrouble) {
  World w;
  std::vector<PointSample> samples = Samples(w);
  for (PointSample& s : samples) s.log_light = {-2, -2, -2};
  ExpectNothing(EstimateResponse(w.photos, samples), w.photos);
}

TEST(Response, SamplesThatAreNotFiniteDoNotCount) {
  World w;
  w.gains = Jitter(w.photos, 0.35);
  w.vignette = {-1.73, 0, 0};
  std::vector<PointSample> samples = Samples(w);
  for (size_t i = 0; i < samples.size(); i += 7) {
    samples[i].log_light[i % 3] =
        i % 2 ? std::numeric_limits<double>::quiet_NaN() : -std::numeric_limits<double>::infinity();
  }
  const CaptureResponse have = EstimateResponse(w.photos, samples);
  EXPECT_LT(WorstGain(have, w.gains), 0.01);
  EXPECT_LT(WorstVignette(have.vignette, w.vignette), 0.02);
}

TEST(Response, APhotoThatSharesNothingIsNoTrouble) {
  World w;
  w.gains = Jitter(w.photos, 0.35);
  std::vector<PointSample> samples = Samples(w);
  int point = 100000;
  for (PointSample& s : samples) {
    if (s.photo == 7) s.point = ++point;
  }
  std::stable_sort(samples.begin(), samples.end(),
                   [](const PointSample& a, const PointSample& b) { return a.point < b.point; });
  const CaptureResponse have = EstimateResponse(w.photos, samples);
  ASSERT_EQ(have.gains.size(), size_t(w.photos));
  for (const auto& gain : have.gains) {
    for (const double g : gain) EXPECT_TRUE(std::isfinite(g));
  }
  EXPECT_NEAR(have.gains[7][0], 1, 0.5);
}

TEST(Response, AVignetteNeverRisesAndIsBounded) {
  World w;
  w.vignette = {1, 0, 0};  // brighter at the corners
  EXPECT_EQ(EstimateResponse(w.photos, Samples(w)).vignette, kNone);
  w.vignette = {-9, 0, 0};  // 13 stops
  const Vignette have = EstimateResponse(w.photos, Samples(w)).vignette;
  EXPECT_NEAR(CornerStops(have), kMostVignette, 1e-9);
  for (double r = 0; r < 1; r += 0.01)
    EXPECT_LE(LogVignette(have, r + 0.01), LogVignette(have, r) + 1e-12);
}

TEST(Response, WhatNoSampleShowsOfTheCornersStaysMild) {
  World w;
  w.most_radius = 0.75;
  w.noise = 0.08;
  w.vignette = {-1.73, 0, 0};
  EXPECT_LT(WorstVignette(EstimateResponse(w.photos, Samples(w)).vignette, w.vignette), 0.6);
}

TEST(Response, ASmallVignetteIsTheCameras) {
  World w;
  w.noise = 0.05;
  w.vignette = {-0.3 * kStop, 0, 0};
  EXPECT_EQ(EstimateResponse(w.photos, Samples(w)).vignette, kNone);
}

TEST(Response, SlowDriftOfColorStaysAndWhatAPhotoDiffersByGoes) {
  World w;
  w.photos = 40;
  w.gains.resize(w.photos);
  for (int i = 0; i < w.photos; ++i) w.gains[i] = {0.2 * i / w.photos, 0, 0};
  w.gains[20][0] += 0.3;
  const std::vector<PointSample> samples = Samples(w);
  const CaptureResponse all = EstimateResponse(w.photos, samples);
  EXPECT_GT(all.gains[35][0] / all.gains[5][0], std::exp(0.12));
  const CaptureResponse own = WithoutColorDrift(all, samples);
  EXPECT_NEAR(std::log(own.gains[30][0] / own.gains[10][0]), 0, 0.03);
  EXPECT_NEAR(std::log(own.gains[20][0]), 0.3, 0.05);
}

RadialFrame FrameOf(const Photo& photo) {
  return {photo.width / 2.0, photo.height / 2.0, std::hypot(photo.width, photo.height) / 2};
}

Photo Ramp() {
  Photo photo(64, 48);
  for (size_t i = 0; i < photo.data.size(); ++i)
    photo.data[i] = static_cast<int16_t>((i * 37) % 13000) - 200;
  return photo;
}

TEST(Response, ApplyingUndoesTheCamera) {
  const std::array<double, 3> gain = {1.3, 1, 0.8};
  const Vignette vignette = {-0.7, -0.2, -0.1};
  Photo photo = Ramp();
  const RadialFrame frame = FrameOf(photo);
  const Photo before = photo;
  ApplyResponse(gain, vignette, frame, &photo);
  for (int y = 0; y < photo.height; ++y) {
    for (int x = 0; x < photo.width; ++x) {
      const double r = std::hypot(x + 0.5 - frame.cx, y + 0.5 - frame.cy) / frame.half_diagonal;
      for (int c = 0; c < 3; ++c) {
        const double light = LinearFromSrgb(EncodedOf(before.pixel(x, y)[c])) / gain[c] /
                             std::exp(LogVignette(vignette, r));
        ASSERT_NEAR(photo.pixel(x, y)[c], kPhotoWhite * SrgbFromLinear(light), 1)
            << x << " " << y << " " << c;
      }
    }
  }
}

TEST(Response, ApplyingNothingChangesNothing) {
  Photo photo = Ramp();
  const Photo before = photo;
  ApplyResponse({1, 1, 1}, kNone, FrameOf(photo), &photo);
  EXPECT_EQ(photo.data, before.data);
}

TEST(Response, ClippedSamplesStayClippedAndOrderStays) {
  Photo photo(2 * kPhotoWhite / 16, 1);
  for (int x = 0; x < photo.width; ++x) {
    for (int c = 0; c < 3; ++c) photo.pixel(x, 0)[c] = static_cast<int16_t>(8 * x + 1);
  }
  ApplyResponse({1.35, 1, 0.7}, kNone, FrameOf(photo), &photo);
  for (int x = 1; x < photo.width; ++x) {
    for (int c = 0; c < 3; ++c) ASSERT_GE(photo.pixel(x, 0)[c], photo.pixel(x - 1, 0)[c]);
  }
  Photo white(1, 1);
  for (int c = 0; c < 3; ++c) white.pixel(0, 0)[c] = kPhotoWhite;
  ApplyResponse({1.35, 1, 0.7}, kNone, FrameOf(white), &white);
  for (int c = 0; c < 3; ++c) EXPECT_GE(white.pixel(0, 0)[c], kPhotoWhite - 1);
}

TEST(Response, SamplesAreOfPatchesAndPointsThatClipAreLeftOut) {
  Photo grey(40, 40), bright(40, 40);
  std::fill(grey.data.begin(), grey.data.end(), kPhotoWhite / 2);
  std::fill(bright.data.begin(), bright.data.end(), kPhotoWhite / 2);
  bright.pixel(30, 30)[1] = kPhotoWhite;
  const std::vector<Photo> photos = {grey, bright};
  const std::vector<RadialFrame> frames(2, FrameOf(grey));
  const std::vector<PointSighting> sightings = {{0, 0, 20, 20}, {0, 1, 10, 20}, {1, 0, 30, 30},
                                                {1, 1, 30, 30}, {2, 0, 1, 1},   {2, 1, 20, 5}};
  const std::vector<PointSample> samples = SamplePoints(photos, sightings, frames);
  ASSERT_EQ(samples.size(), 3u);  // point 1 is clipped in one photo, point 2 cut off in one
  EXPECT_NEAR(samples[0].log_light[1], std::log(LinearFromSrgb(0.5)), 1e-3);
  EXPECT_NEAR(samples[0].radius, 0, 1e-9);
  EXPECT_NEAR(samples[1].radius, 10 / (20 * std::sqrt(2)), 1e-9);
  EXPECT_EQ(samples[2].point, 2);
  PlaneU8 mask(40, 40);
  std::fill(mask.data.begin(), mask.data.end(), kCounts);
  mask.data[20 * 40 + 20] = 0;
  EXPECT_EQ(SamplePoints(photos, sightings, frames, std::vector<PlaneU8>{mask, PlaneU8()}).size(),
            2u);
}

TEST(Response, AChannelThatIsBlackTellsFalloffAndNoColor) {
  World w;
  w.gains = Jitter(w.photos, 0.35);
  w.vignette = {-0.5, -0.4, -0.6};
  std::vector<PointSample> samples = Samples(w);
  for (PointSample& s : samples) {
    s.tells_color = false;
    s.log_light[2] = -20;
  }
  const CaptureResponse have = EstimateResponse(w.photos, samples);
  for (const CaptureResponse& response : {have, WithoutColorDrift(have, samples)}) {
    ASSERT_EQ(response.gains.size(), size_t(w.photos));
    for (const auto& gain : response.gains) EXPECT_THAT(gain, ElementsAre(1, 1, 1));
  }
  EXPECT_GT(CornerStops(have.vignette), 1.5);
}

TEST(Response, SamplesOfBlackChannelsTellNoColorInAnyPhoto) {
  Photo warm(40, 40), grey(40, 40);
  for (int i = 0; i < 40 * 40; ++i) {
    warm.data[3 * i] = warm.data[3 * i + 1] = kPhotoWhite / 2;
    for (int c = 0; c < 3; ++c) grey.data[3 * i + c] = kPhotoWhite / 2;
  }
  const std::vector<RadialFrame> frames(2, FrameOf(grey));
  const std::vector<PointSample> samples = SamplePoints(
      std::vector<Photo>{warm, grey},
      std::vector<PointSighting>{{0, 0, 20, 20}, {0, 1, 20, 20}, {1, 1, 10, 20}}, frames);
  ASSERT_EQ(samples.size(), 3u);
  EXPECT_FALSE(samples[0].tells_color);
  EXPECT_FALSE(samples[1].tells_color);
  EXPECT_TRUE(samples[2].tells_color);
  EXPECT_LT(samples[0].log_light[2], -10);
  EXPECT_TRUE(std::isfinite(samples[0].log_light[2]));
}

TEST(Response, SaysWhatItFound) {
  EXPECT_THAT(DescribeResponse({{{1, 1, 1}}, kNone}), IsEmpty());
  EXPECT_THAT(DescribeResponse({{{1, 1, 1}, {1.12, 1, 0.95}}, {-1.3 * kStop, 0, 0}}),
              ElementsAre(HasSubstr("by up to 12 %"), HasSubstr("1.3 stops darker")));
  EXPECT_THAT(DescribeResponse({{{1, 1, 1}}, {-1.3 * kStop, 0, 0}, 1.84, 3}),
              ElementsAre(HasSubstr("lamp's beam make corners 1.3"), HasSubstr("power of 1.8")));
}

}  // namespace
}  // namespace litags
