#include "engine/io/ycbcr.h"

#include <algorithm>
#include <cmath>

namespace litags {
namespace {

using Matrix = std::array<std::array<double, 3>, 3>;

// Y = kr R + (1 - kr - kb) G + kb B; Cb and Cr are B - Y and R - Y, within 0.5 of 0.
struct LumaWeights {
  double kr, kb;
};

LumaWeights WeightsOf(int matrix, int primaries) {
  constexpr LumaWeights kBt601 = {0.299, 0.114}, kBt709 = {0.2126, 0.0722},
                        kBt2020 = {0.2627, 0.0593}, kP3 = {0.2290, 0.0793};
  switch (matrix) {
    case 1:
      return kBt709;
    case 4:
      return {0.30, 0.11};
    case 7:
      return {0.212, 0.087};
    case 9:
    case 10:
      return kBt2020;
    case 12:  // those of the primaries
      return primaries == 1 ? kBt709 : primaries == 9 ? kBt2020 : primaries == 12 ? kP3 : kBt601;
    default:
      return kBt601;
  }
}

Matrix MatrixOf(int matrix, int primaries) {
  if (matrix == 0) return {{{0, 0, 1}, {1, 0, 0}, {0, 1, 0}}};     // G, B, R
  if (matrix == 8) return {{{1, -1, 1}, {1, 1, 0}, {1, -1, -1}}};  // YCgCo
  const auto [kr, kb] = WeightsOf(matrix, primaries);
  const double kg = 1 - kr - kb, red = 2 * (1 - kr), blue = 2 * (1 - kb);
  return {{{1, 0, red}, {1, -kb * blue / kg, -kr * red / kg}, {1, blue, 0}}};
}

}  // namespace

std::vector<Tap> TapsOf(int size, int n, double ratio, ChromaSite site) {
  std::vector<Tap> taps(size);
  for (int i = 0; i < size; ++i) {
    const double at = site == ChromaSite::kCentre ? (i + 0.5) * ratio - 0.5 : i * ratio;
    const int low = static_cast<int>(std::floor(at));
    taps[i] = {std::clamp(low, 0, n - 1), std::clamp(low + 1, 0, n - 1),
               static_cast<float>(at - low)};
  }
  return taps;
}

bool IsEachItself(const std::vector<Tap>& taps, int n) {
  if (taps.size() != static_cast<size_t>(n)) return false;
  for (int i = 0; i < n; ++i) {
    if (taps[i].low != i || taps[i].weight != 0) return false;
  }
  return true;
}

LumaRange LumaRangeOf(const YCbCrKind& kind) {
  if (kind.full_range) return {0, std::exp2(kind.bits) - 1};
  const double unit = std::exp2(kind.bits - 8);
  return {16 * unit, 235 * unit};
}

YCbCrToRgb::YCbCrToRgb(const YCbCrKind& kind) {
  const auto [black, white] = LumaRangeOf(kind);
  const double unit = std::exp2(kind.bits - 8), luma_range = white - black;
  const bool all_luma = kind.matrix == 0;
  const double chroma_range = all_luma || kind.full_range ? luma_range : 224 * unit;
  const double grey = all_luma ? black : 128 * unit;
  zero_ = {static_cast<float>(black), static_cast<float>(grey), static_cast<float>(grey)};
  const Matrix matrix = MatrixOf(kind.matrix, kind.primaries);
  for (int c = 0; c < 3; ++c) {
    for (int k = 0; k < 3; ++k) {
      scale_[c][k] = static_cast<float>(matrix[c][k] / (k == 0 ? luma_range : chroma_range));
    }
  }
}

void YCbCrToRgb::Convert(const float* luma, const float* cb, const float* cr, size_t pixels,
                         float* rgb) const {
  for (size_t i = 0; i < pixels; ++i, rgb += 3) {
    const float y = luma[i] - zero_[0], b = cb[i] - zero_[1], r = cr[i] - zero_[2];
    for (int c = 0; c < 3; ++c) rgb[c] = scale_[c][0] * y + scale_[c][1] * b + scale_[c][2] * r;
  }
}

}  // namespace litags
