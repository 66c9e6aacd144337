#include "engine/noise/noise_estimate.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace litags {

void NoiseEstimate::AddDifference(float magnitude) {
  const auto last = static_cast<long>(counts_.size()) - 1;
  counts_[std::min(std::lrint(magnitude * kBins), last)] += 1;
}

void NoiseEstimate::Add(const NoiseEstimate& other) {
  for (size_t i = 0; i < counts_.size(); ++i) counts_[i] += other.counts_[i];
}

double NoiseEstimate::Deviation() const {
  const int64_t samples = std::accumulate(counts_.begin(), counts_.end(), int64_t{0});
  int64_t below = 0;
  for (size_t bin = 0; bin < counts_.size(); ++bin) {
    const int64_t next = below + counts_[bin];
    if (4 * next >= samples && next > below) {
      const double part = (0.25 * samples - below) / (next - below);  // of the bin, +- 1/2
      const double quartile = std::max(0.0, bin - 0.5 + part) / kBins;
      return quartile / (0.3186 * std::sqrt(1.25));
    }
    below = next;
  }
  return 0;
}

NoiseEstimate NoiseOf(const Photo& picture, const PlaneU8& mask) {
  NoiseEstimate noise;
  ForEachDifference(picture, mask, [&](size_t sample, float magnitude) {
    const float encoded = EncodedOf(picture.data[sample]);
    if (encoded > 1 - kBelowWhite && encoded <= kBelowWhite) noise.AddDifference(magnitude);
  });
  return noise;
}

NoiseEstimate NoiseOfChannel(const float* channel, int width, int height, const PlaneU8& mask,
                             float most) {
  NoiseEstimate noise;
  for (int y = 1; y + 1 < height; ++y) {
    for (int x = 1; x + 1 < width; ++x) {
      const float* at = channel + size_t(y) * width + x;
      if (!(*at > 0 && *at <= most) || !NeighboursCount(mask, x, y)) continue;
      const float around = at[-1] + at[1] + *(at - width) + at[width];
      noise.AddDifference(255 * std::abs(*at - around / 4));
    }
  }
  return noise;
}

}  // namespace litags
