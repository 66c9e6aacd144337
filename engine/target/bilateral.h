// The joint bilateral filter of SmoothChroma, for the sources of this folder only.
#ifndef LITAGS_ENGINE_TARGET_BILATERAL_H_
#define LITAGS_ENGINE_TARGET_BILATERAL_H_

#include <array>
#include <vector>

#include "engine/target/float_image.h"

namespace litags {

inline constexpr int kBilateralTaps = 2;      // to either side
inline constexpr int kBilateralSpacing = 4;   // px
inline constexpr double kBilateralSigma = 4;  // px
inline constexpr int kBilateralMargin = kBilateralTaps * kBilateralSpacing;

// Means of an image over the taps around each pixel whose guides are like the guide there. A tap
// counts by its distance and by (1 - d^2 per_range)^3, where d is the guides' distance: alike
// exp(-d^2 / 2) for per_range = 1 / 6 where it matters, and exactly 0 far away. Taps beyond the
// border are those at it. What `mask` leaves out counts at its own pixel only.
class BilateralFilter {
 public:
  BilateralFilter(const FloatImage& image, const FloatImage& guide, const PlaneU8& mask,
                  float per_range);

  // The means of row y; valid until the next call.
  const std::array<const float*, 3>& Row(int y);

 private:
  // One channel with kBilateralMargin more pixels on every side.
  std::vector<float> Pad(const FloatImage& image, int channel) const;
  std::vector<float> Pad(const PlaneU8& mask) const;

  int width_, height_;
  size_t stride_;
  float per_range_;
  std::array<std::vector<float>, 3> image_, guide_;
  std::vector<float> counts_;  // 1 or 0; empty: all pixels count
  std::array<std::vector<float>, 3> row_;
  std::array<const float*, 3> means_;
};

}  // namespace litags

#endif  // LITAGS_ENGINE_TARGET_BILATERAL_H_
