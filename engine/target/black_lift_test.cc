#include "engine/target/black_lift.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <vector>

#include "engine/core/rng.h"

namespace litags {
namespace {

constexpr int kWidth = 200, kHeight = 150;
constexpr double kNoise = 0.002;  // linear light; 7 codes at black

// Photos with such noise of a scene whose light is `light` of how far a pixel is to the right.
std::vector<Photo> Photos(double noise, const std::function<double(double x)>& light) {
  std::vector<Photo> photos(3, Photo(kWidth, kHeight));
  for (size_t i = 0; i < photos.size(); ++i) {
    const CounterRng rng(7, i);
    ImageU8 codes(kWidth, kHeight);
    for (size_t k = 0; k < codes.data.size(); ++k) {
      const double sensor = light(k / 3 % kWidth / double{kWidth}) + noise * rng.Normal(k);
      codes.data[k] =
          static_cast<uint8_t>(std::lround(255 * SrgbFromLinear(std::clamp(sensor, 0.0, 1.0))));
    }
    photos[i] = PhotoFromU8(codes);
  }
  return photos;
}

// From black to ten deviations of the noise.
double FromBlack(double x) { return 0.02 * std::max(0.0, x - 0.1); }

TEST(BlackLift, TheMeanOfNoisySamplesGoesBackToTheLight) {
  const CounterRng rng(3, 0);
  constexpr int kSamples = 100000;
  for (const double light : {0.0, 0.5, 1.0, 2.0, 4.0}) {
    double sum = 0;
    for (int i = 0; i < kSamples; ++i) sum += std::max(0.0, light + rng.Normal(i));
    for (const double noise : {1.0, 0.03}) {
      // Three deviations of the mean of so many are 0.01; in darkness the mean grows half as fast.
      EXPECT_NEAR(WithoutLift(noise * sum / kSamples, noise), noise * light, 0.02 * noise) << light;
    }
  }
  EXPECT_EQ(WithoutLift(0.1, 1), 0) << "darker than darkness gets";
  EXPECT_EQ(WithoutLift(0.1, 0), 0.1);
  EXPECT_EQ(WithoutLift(100, 1), 100);
}

TEST(BlackLift, NoiseIsToldFromTheDarkestPlaces) {
  const std::vector<double> gains(3, 16.0);
  const double have = NoiseAtBlack(Photos(kNoise, FromBlack), gains, 2);
  // The darkest windows are dark by chance, too, so that it is rather too little.
  EXPECT_GT(have, 0.55 * 16 * kNoise);
  EXPECT_LT(have, 1.05 * 16 * kNoise);
  EXPECT_EQ(have, NoiseAtBlack(Photos(kNoise, FromBlack), gains, 1));
  EXPECT_EQ(NoiseAtBlack(Photos(0, [](double) { return 0.0; }), gains, 1), 0);
  EXPECT_EQ(NoiseAtBlack({}, {}, 1), 0);
}

// The mean of four pixels is as bright as they are, and has half of their noise.
Photo Halved(const Photo& photo) {
  Photo half(photo.width / 2, photo.height / 2);
  const LinearTable& linear = LinearTable::Get();
  for (int y = 0; y < half.height; ++y) {
    for (int x = 0; x < half.width; ++x) {
      for (int c = 0; c < 3; ++c) {
        float sum = 0;
        for (int k = 0; k < 4; ++k) sum += linear(photo.pixel(2 * x + k % 2, 2 * y + k / 2)[c]);
        half.pixel(x, y)[c] = SampleTable::Get()(sum / 4);
      }
    }
  }
  return half;
}

TEST(BlackLift, ShrunkPhotosAreLiftedAsMuch) {
  const std::vector<double> gains(3, 16.0);
  const std::vector<Photo> photos = Photos(kNoise, FromBlack);
  std::vector<Photo> halves;
  for (const Photo& photo : photos) halves.push_back(Halved(Halved(photo)));
  const double have = NoiseAtBlack(halves, gains, 1, {}, /*noise_kept=*/0.25);
  EXPECT_GT(have, 0.55 * 16 * kNoise);
  EXPECT_LT(have, 1.05 * 16 * kNoise);
  EXPECT_LT(NoiseAtBlack(halves, gains, 1), 0.5 * 16 * kNoise) << "as if they had not been shrunk";
}

TEST(BlackLift, WithoutNoiseDarkScenesStayAsTheyAre) {
  const std::vector<double> gains(3, 16.0);
  const double have = NoiseAtBlack(Photos(0, [](double x) { return 0.002 + 0.02 * x; }), gains, 1);
  for (const double light : {0.032, 0.05, 0.3})
    EXPECT_NEAR(WithoutLift(light, have), light, 0.001 * light);
}

TEST(BlackLift, ScenesWithoutBlackAreHardlyDarkened) {
  const auto bright = [](double x) { return 4 * kNoise + 0.02 * x; };
  const double have = NoiseAtBlack(Photos(kNoise, bright), std::vector<double>(3, 16.0), 1);
  EXPECT_NEAR(WithoutLift(16 * bright(0), have), 16 * bright(0), 0.03 * 16 * bright(0));
}

TEST(BlackLift, WhatAMaskLeavesOutSaysNothing) {
  const std::vector<Photo> photos = Photos(kNoise, FromBlack);
  const std::vector<double> gains(3, 16.0);
  PlaneU8 mask(kWidth, kHeight);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) mask.data[y * kWidth + x] = x < kWidth / 2 ? 255 : 0;
  }
  const std::vector<PlaneU8> dark(3, mask);
  for (uint8_t& counts : mask.data) counts = 255 - counts;
  const std::vector<PlaneU8> bright(3, mask);
  EXPECT_GT(NoiseAtBlack(photos, gains, 1, dark), 0.55 * 16 * kNoise);
  // The left half of it is black; the right one begins at four deviations.
  const double light = 16 * FromBlack(0.5);
  EXPECT_NEAR(WithoutLift(light, NoiseAtBlack(photos, gains, 1, bright)), light, 0.03 * light);
}

}  // namespace
}  // namespace litags
