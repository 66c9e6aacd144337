// How much noise a picture has: for photos, targets and single channels.
#ifndef LITAGS_ENGINE_NOISE_NOISE_ESTIMATE_H_
#define LITAGS_ENGINE_NOISE_NOISE_ESTIMATE_H_

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstdlib>

#include "engine/core/image.h"
#include "engine/core/mask.h"
#include "engine/core/photo.h"

namespace litags {

// The noise's standard deviation from how samples differ from the mean of their four neighbours.
// Those differences have sqrt(5/4) of the noise's deviation, and a normal distribution's lower
// quartile of magnitudes is 0.3186 of its deviation. Flat areas set that quartile, not edges; fine
// texture all over a picture counts as noise. Differences are counted, so that the result does not
// depend on their order. Unit: 8-bit codes.
class NoiseEstimate {
 public:
  void AddDifference(float magnitude);
  void Add(const NoiseEstimate& other);

  // 0 if nothing was added.
  double Deviation() const;

 private:
  static constexpr int kBins = 16;  // to a code

  std::array<int64_t, 256 * kBins> counts_ = {};
};

// Calls visit(sample, magnitude) for every sample of the picture but the border's whose pixel and
// neighbours count (engine/core/mask.h): its index in the data, and how it differs from the mean of
// its neighbours; codes of 255.
template <class Visit>
void ForEachDifference(const Photo& picture, const PlaneU8& mask, const Visit& visit) {
  constexpr float kCodes = 1 / (4 * kPhotoCode);
  const size_t row = 3 * size_t(picture.width);
  for (int y = 1; y + 1 < picture.height; ++y) {
    for (int x = 1; x + 1 < picture.width; ++x) {
      if (!NeighboursCount(mask, x, y)) continue;
      for (size_t sample = y * row + 3 * x; sample < y * row + 3 * x + 3; ++sample) {
        const int16_t* at = picture.data.data() + sample;
        const int difference = std::abs(4 * *at - (at[-3] + at[3] + *(at - row) + at[row]));
        visit(sample, difference * kCodes);
      }
    }
  }
}

// Encoded samples up to here do not round to white.
inline constexpr float kBelowWhite = 1 - 0.5f / 255;

// The noise of all channels, without samples that round to black or white: noise is cut off there.
NoiseEstimate NoiseOf(const Photo& picture, const PlaneU8& mask);

// The noise of one channel, values in [0, 1], row by row: of samples in (0, most].
NoiseEstimate NoiseOfChannel(const float* channel, int width, int height, const PlaneU8& mask,
                             float most);

}  // namespace litags

#endif  // LITAGS_ENGINE_NOISE_NOISE_ESTIMATE_H_
