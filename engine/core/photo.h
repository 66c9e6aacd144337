// Photos and their targets, from the decoder to the losses: more precise than 8 bits, since in the
// dark the bits below the eighth are the picture.
#ifndef LITAGS_ENGINE_CORE_PHOTO_H_
#define LITAGS_ENGINE_CORE_PHOTO_H_

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include "engine/core/color.h"
#include "engine/core/image.h"

namespace litags {

// sRGB-encoded samples in fixed point: kPhotoWhite is 1.0, a 64th of an 8-bit code is the step.
// Samples may lie below 0 (noise around black stays symmetric) and above 1, within [-2, 2).
using Photo = Image<int16_t>;

inline constexpr int kPhotoWhite = 1 << 14;

// One 8-bit code, in samples.
inline constexpr float kPhotoCode = kPhotoWhite / 255.0f;

// Samples from here on may be light that was cut off at white: JPEG moves white by a code.
inline constexpr auto kClippedSample = static_cast<int16_t>(253.5f * kPhotoCode);

// A pixel with a sample from here on may be partly clipped, by JPEG's blocks or a lens: its colour
// is not that of the light.
inline constexpr auto kTintedSample = static_cast<int16_t>(250 * kPhotoCode);

inline float EncodedOf(int16_t sample) { return sample * (1.0f / kPhotoWhite); }

// The nearest int16, halves to even; NaN becomes 0. As lrint, which compilers call one by one.
inline int16_t NearestSample(float value) {
  constexpr float kWhole = 12582912;  // 1.5 * 2^23: floats from here are whole numbers
  const float number = value == value ? value : 0;
  const float inside = std::min(std::max(number, -32768.0f), 32767.0f);
  return static_cast<int16_t>(static_cast<int32_t>((inside + kWhole) - kWhole));
}

// The nearest sample; NaN becomes 0.
inline int16_t PhotoSample(float encoded) { return NearestSample(encoded * kPhotoWhite); }

// Linear light of every sample; 1: the photo's white. Below black the curve goes on as a line.
class LinearTable {
 public:
  static const LinearTable& Get() {
    static const LinearTable table;
    return table;
  }
  float operator()(int16_t sample) const { return values_[sample + 32768]; }

 private:
  LinearTable() : values_(65536) {
    for (int i = 0; i < 65536; ++i) {
      values_[i] = static_cast<float>(LinearFromSrgb((i - 32768.0) / kPhotoWhite));
    }
  }
  std::vector<float> values_;
};

// The sample of linear light, within 1/8 of a step of SrgbFromLinear. A table over the root of
// light, along which the curve is smooth, for its power function is slow.
class SampleTable {
 public:
  static const SampleTable& Get() {
    static const SampleTable table;
    return table;
  }
  int16_t operator()(float linear) const {
    if (!(linear > 0)) return PhotoSample(linear * 12.92f);
    const float at = std::sqrt(std::min(linear, kMost)) * kSteps;
    const int i = static_cast<int>(at);
    return PhotoSample(values_[i] + (at - i) * (values_[i + 1] - values_[i]));
  }

 private:
  static constexpr float kMost = 4.96f;  // encoded 2, the end of the samples' range
  static constexpr int kSteps = 4096;    // per unit of the root
  SampleTable() {
    for (int i = 0; i < kSteps * std::sqrt(kMost) + 2; ++i) {
      values_.push_back(static_cast<float>(SrgbFromLinear(std::pow(i / double(kSteps), 2))));
    }
  }
  std::vector<float> values_;
};

inline Photo PhotoFromU8(const ImageU8& image) {
  Photo photo(image.width, image.height);
  std::array<int16_t, 256> samples;
  for (int code = 0; code < 256; ++code) samples[code] = PhotoSample(code / 255.0f);
  std::transform(image.data.begin(), image.data.end(), photo.data.begin(),
                 [&](uint8_t code) { return samples[code]; });
  return photo;
}

// Rounded to 8 bits, for pictures that are shown and for programs that take nothing else.
inline ImageU8 PhotoToU8(const Photo& photo) {
  ImageU8 image(photo.width, photo.height);
  std::transform(photo.data.begin(), photo.data.end(), image.data.begin(), [](int16_t sample) {
    const int clamped = std::clamp<int>(sample, 0, kPhotoWhite);
    return static_cast<uint8_t>((clamped * 255 + kPhotoWhite / 2) / kPhotoWhite);
  });
  return image;
}

// Samples to [3, H, W] floats, sRGB-encoded.
inline Planes ToPlanes(const Photo& photo) {
  Planes planes(3, photo.height, photo.width);
  for (int c = 0; c < 3; ++c) {
    float* out = planes.plane(c);
    for (size_t i = 0; i < photo.pixels(); ++i) out[i] = EncodedOf(photo.data[3 * i + c]);
  }
  return planes;
}

}  // namespace litags

#endif  // LITAGS_ENGINE_CORE_PHOTO_H_
