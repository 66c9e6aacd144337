#include "engine/target/chroma.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <random>

#include "engine/core/color.h"
#include "engine/core/mask.h"

namespace litags {
namespace {

constexpr int kWidth = 120, kHeight = 80;
constexpr double kGain = 64;     // the photo is six stops under
constexpr double kStrength = 2;  // the default

double Curve(double linear) { return SrgbFromLinear(std::clamp(kGain * linear, 0.0, 1.0)); }

// Orange and a green of the same luma, side by side; codes after the curve.
std::array<double, 3> TwoColors(int x, int) {
  return x < kWidth / 2 ? std::array<double, 3>{0.60, 0.40, 0.25}
                        : std::array<double, 3>{0.30, 0.51, 0.30};
}

// A dark photo of a scene whose codes are given, with normal noise of a deviation in codes of the
// photo, each channel its own.
template <class Scene>
Photo Dark(const Scene& scene, double noise) {
  std::mt19937 random(1);
  std::normal_distribution<double> normal(0, 1);
  ImageU8 photo(kWidth, kHeight);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const std::array<double, 3> code = scene(x, y);
      for (int c = 0; c < 3; ++c) {
        const double exact = 255 * SrgbFromLinear(LinearFromSrgb(code[c]) / kGain);
        photo.pixel(x, y)[c] = static_cast<uint8_t>(
            std::lround(std::clamp(exact + noise * normal(random), 0.0, 255.0)));
      }
    }
  }
  return PhotoFromU8(photo);
}

double Luma(const uint8_t* p) { return 0.299 * p[0] + 0.587 * p[1] + 0.114 * p[2]; }

// Root of the mean square of (channel - luma) against the scene's, codes of 255, over columns.
template <class Scene>
double ChromaError(const ImageU8& image, const Scene& scene, int from, int to) {
  double squares = 0;
  int64_t n = 0;
  for (int y = 0; y < kHeight; ++y) {
    for (int x = from; x < to; ++x) {
      const std::array<double, 3> code = scene(x, y);
      const double luma = 255 * (0.299 * code[0] + 0.587 * code[1] + 0.114 * code[2]);
      for (int c = 0; c < 3; ++c, ++n) {
        const double chroma = image.pixel(x, y)[c] - Luma(image.pixel(x, y));
        squares += std::pow(chroma - (255 * code[c] - luma), 2);
      }
    }
  }
  return std::sqrt(squares / n);
}

TEST(Chroma, NoiseOfColorsIsAveraged) {
  const Photo photo = Dark(TwoColors, 1.0);
  const ImageU8 as_it_is = PhotoToU8(SmoothChroma(photo, kGain, 0, Curve));
  const ImageU8 smooth = PhotoToU8(SmoothChroma(photo, kGain, kStrength, Curve));
  const double before = ChromaError(as_it_is, TwoColors, 0, kWidth / 2 - 12);
  EXPECT_GT(before, 8);  // the test is worth something
  EXPECT_LT(ChromaError(smooth, TwoColors, 0, kWidth / 2 - 12), 0.35 * before);
}

TEST(Chroma, BrightnessStaysPixelByPixel) {
  const Photo photo = Dark(TwoColors, 1.0);
  const Photo smooth = SmoothChroma(photo, kGain, kStrength, Curve);
  for (int i = 0; i < kWidth * kHeight; ++i) {
    double before = 0, after = 0;
    const double weights[] = {0.299, 0.587, 0.114};
    for (int c = 0; c < 3; ++c) {
      before += weights[c] * kGain * LinearTable::Get()(photo.data[3 * i + c]);
      after += weights[c] * LinearTable::Get()(smooth.data[3 * i + c]);
    }
    if (before > 0.6) continue;  // a channel may be clipped
    EXPECT_NEAR(after, before, 0.006) << i;
  }
}

TEST(Chroma, AnEdgeOfLikeBrightnessKeepsItsColors) {
  // Half a code of noise; the two halves differ by colour alone.
  const ImageU8 smooth = PhotoToU8(SmoothChroma(Dark(TwoColors, 0.5), kGain, kStrength, Curve));
  const int middle = kWidth / 2;
  // 3 px beside the edge: red less green is +51 and -54 codes.
  for (const auto& [x, sign] : {std::pair{middle - 4, 1}, {middle + 3, -1}}) {
    double difference = 0;
    for (int y = 0; y < kHeight; ++y) {
      difference += double(smooth.pixel(x, y)[0]) - smooth.pixel(x, y)[1];
    }
    EXPECT_GT(sign * difference / kHeight, 42) << x;  // 33 and less if all neighbours counted
  }
}

TEST(Chroma, WhatIsMaskedGivesNoColor) {
  // Nearly alike, so that nothing but the mask tells the halves apart.
  const auto scene = [](int x, int) {
    return x < kWidth / 2 ? std::array<double, 3>{0.50, 0.50, 0.50}
                          : std::array<double, 3>{0.56, 0.47, 0.50};
  };
  const Photo photo = Dark(scene, 1.0);
  PlaneU8 mask(kWidth, kHeight);
  for (int i = 0; i < kWidth * kHeight; ++i) mask.data[i] = i % kWidth < kWidth / 2 ? kCounts : 0;
  const auto red_less_green = [&](const Photo& photo) {
    const ImageU8 image = PhotoToU8(photo);
    double sum = 0;
    for (int y = 0; y < kHeight; ++y) {
      for (int x = kWidth / 2 - 7; x < kWidth / 2 - 3; ++x) {
        sum += double(image.pixel(x, y)[0]) - image.pixel(x, y)[1];
      }
    }
    return sum / (4 * kHeight);
  };
  const double all = red_less_green(SmoothChroma(photo, kGain, kStrength, Curve));
  const double masked = red_less_green(SmoothChroma(photo, kGain, kStrength, Curve, mask));
  EXPECT_LT(masked, all - 1);
}

TEST(Chroma, PhotosWithLittleNoiseOnlyGoThroughTheCurve) {
  const auto ramps = [](int x, int y) {
    return std::array<double, 3>{0.9 * x / kWidth, 0.9 * y / kHeight, 0.4};
  };
  // Well lit: noise of a code that no gain makes visible.
  ImageU8 photo(kWidth, kHeight);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      for (int c = 0; c < 3; ++c) {
        photo.pixel(x, y)[c] = static_cast<uint8_t>(std::lround(255 * ramps(x, y)[c]));
      }
    }
  }
  std::mt19937 random(1);
  for (uint8_t& code : photo.data) code = std::min<int>(255, code + random() % 3);
  const auto identity = [](double linear) { return SrgbFromLinear(linear); };
  const Photo smooth = SmoothChroma(PhotoFromU8(photo), 1, kStrength, identity);
  EXPECT_EQ(PhotoToU8(smooth).data, photo.data);
}

TEST(Chroma, NoiseAroundBlackStaysSymmetric) {
  std::mt19937 random(1);
  std::normal_distribution<double> normal(0, 1);
  Photo photo(kWidth, kHeight);
  for (int16_t& sample : photo.data) sample = PhotoSample(normal(random) / 255);
  for (const double strength : {0.0, kStrength}) {
    const Photo target = SmoothChroma(photo, kGain, strength, Curve);
    double sum = 0;
    int most = 0;
    for (const int16_t sample : target.data) {
      sum += sample;
      most = std::max(most, std::abs(sample));
    }
    // Four deviations and more of a code each, times the gain along the line at black; brightness
    // bends over the curve, so above black it is less.
    EXPECT_LT(most, 6 * kGain * kPhotoCode);
    EXPECT_LT(std::abs(sum / target.data.size()), 16 * kPhotoCode) << strength;
  }
  for (int16_t& sample : photo.data) sample = static_cast<int16_t>(std::clamp<int>(sample, -3, 3));
  const Photo target = SmoothChroma(photo, kGain, 0, Curve);
  for (size_t i = 0; i < photo.data.size(); ++i) {
    ASSERT_NEAR(target.data[i], kGain * photo.data[i], 2) << i;
  }
}

// A lens that is dark at the corners and a white balance are taken out before: light goes beyond
// the photo's white, and a photo brighter than its capture is made darker.
TEST(Chroma, LightBeyondWhiteIsNotCutOffWhereThePhotoIsMadeDarker) {
  constexpr double kDarker = 0.6;
  const auto curve = [](double linear) {
    return SrgbFromLinear(std::clamp(kDarker * linear, 0.0, 1.0));
  };
  Photo photo(kWidth, kHeight);
  std::mt19937 random(1);
  for (int16_t& sample : photo.data) {
    sample = PhotoSample(static_cast<float>(SrgbFromLinear(1.5)));
    sample = static_cast<int16_t>(sample + static_cast<int>(random() % 512) - 256);  // noise
  }
  for (const double strength : {0.0, kStrength}) {
    const Photo target = SmoothChroma(photo, kDarker, strength, curve);
    double mean = 0;
    for (const int16_t sample : target.data) mean += EncodedOf(sample) / target.data.size();
    EXPECT_NEAR(mean, SrgbFromLinear(kDarker * 1.5), 2e-3) << strength;
  }
}

TEST(Chroma, OddPhotos) {
  for (const auto& [width, height] : {std::pair{1, 1}, {1, 40}, {40, 1}, {2, 3}, {5, 5}}) {
    for (const int code : {0, 1, 255}) {
      ImageU8 photo(width, height);
      std::fill(photo.data.begin(), photo.data.end(), static_cast<uint8_t>(code));
      photo.data[0] = 3;
      const ImageU8 smooth = PhotoToU8(SmoothChroma(PhotoFromU8(photo), kGain, kStrength, Curve));
      EXPECT_EQ(smooth.data.size(), photo.data.size());
      EXPECT_EQ(smooth.data.back() == 0, photo.data.back() == 0) << width << " " << code;
    }
  }
}

}  // namespace
}  // namespace litags
