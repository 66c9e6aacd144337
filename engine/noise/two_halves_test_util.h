#ifndef LITAGS_ENGINE_NOISE_TWO_HALVES_TEST_UTIL_H_
#define LITAGS_ENGINE_NOISE_TWO_HALVES_TEST_UTIL_H_

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>

#include "engine/core/image.h"
#include "engine/core/photo.h"
#include "engine/core/rng.h"

namespace litags {

inline constexpr int kTwoHalvesSize = 120;  // px, a side

// Left half of code `left`, right half of code `right`, with normal noise of such deviations.
inline Photo TwoHalves(double left, double right, double left_noise = 0, double right_noise = 0) {
  const CounterRng rng(7, 1);
  ImageU8 image(kTwoHalvesSize, kTwoHalvesSize);
  for (size_t i = 0; i < image.data.size(); ++i) {
    const bool is_left = (i / 3) % kTwoHalvesSize < kTwoHalvesSize / 2;
    const double code =
        is_left ? left + left_noise * rng.Normal(i) : right + right_noise * rng.Normal(i);
    image.data[i] = static_cast<uint8_t>(std::clamp(std::round(code), 0.0, 255.0));
  }
  return PhotoFromU8(image);
}

}  // namespace litags

#endif  // LITAGS_ENGINE_NOISE_TWO_HALVES_TEST_UTIL_H_
