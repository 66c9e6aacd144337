// The scene: Gaussians with their stored (not activated) parameters.
#ifndef LITAGS_ENGINE_CORE_SPLATS_H_
#define LITAGS_ENGINE_CORE_SPLATS_H_

#include <cmath>
#include <cstddef>

#include "engine/core/aligned.h"

namespace litags {

// Rows of a Gaussian's parameters, in storage order. Activated values: scales = exp(log_scales),
// opacity = sigmoid(logit_opacity), quats normalised on use (wxyz), colour = SH + 0.5.
enum SplatRow : int {
  kMean = 0,           // 3, world
  kLogScale = 3,       // 3
  kRawQuat = 6,        // 4, wxyz, unnormalised
  kLogitOpacity = 10,  // 1
  kShDc = 11,          // 3, RGB
  kDepth = 14,         // 1, LITA attribute d
  kStructure = 15,     // 1, LITA attribute p
  kNoise = 16,         // 3, LITA attribute n
  kIllumination = 19,  // 3, LITA attribute l
  kShRest = 22,        // 45: coefficients k = 1..15, as ShRow() says
  kSplatRows = 67,
};

constexpr int kMaxShDegree = 3;

// Row of coefficient k = 0..15 of colour channel c.
constexpr int ShRow(int k, int c) { return k == 0 ? kShDc + c : kShRest + 3 * (k - 1) + c; }

// Spherical harmonic of degree 0: a colour that is the same from all sides is 0.5 + kSh0 * kShDc.
constexpr double kSh0 = 0.28209479177387814;

// Rows in use when colours have SH degree 0..3: lower degrees are a prefix.
constexpr int SplatRowsForDegree(int sh_degree) {
  return kShRest + 3 * ((sh_degree + 1) * (sh_degree + 1) - 1);
}

// Gaussians per block: one AVX-512 vector, two AVX2 vectors.
constexpr int kSplatBlock = 16;

// N Gaussians in blocks of 16: each block holds kSplatRows rows of 16 floats, so that a kernel
// over Gaussians streams through one contiguous array (a plain structure of arrays would open 67
// streams). Lanes past size() hold zeros and are never shown.
class Splats {
 public:
  Splats() = default;
  explicit Splats(size_t n) { Resize(n); }

  size_t size() const { return size_; }
  size_t num_blocks() const { return (size_ + kSplatBlock - 1) / kSplatBlock; }

  // Keeps the first min(n, size()) Gaussians; new ones are all zero.
  void Resize(size_t n);

  float* block(size_t b) { return data_.data() + b * kBlockFloats; }
  const float* block(size_t b) const { return data_.data() + b * kBlockFloats; }

  float& at(size_t i, int row) {
    return block(i / kSplatBlock)[row * kSplatBlock + i % kSplatBlock];
  }
  float at(size_t i, int row) const {
    return block(i / kSplatBlock)[row * kSplatBlock + i % kSplatBlock];
  }

  // The first Gaussian with a NaN or an infinity, or size().
  size_t FirstNotFinite() const;

  // All rows of Gaussian `from` of `source` into Gaussian `to` of this.
  void Copy(const Splats& source, size_t from, size_t to);

  const AlignedFloats& data() const { return data_; }
  AlignedFloats& data() { return data_; }

  static constexpr size_t kBlockFloats = size_t{kSplatRows} * kSplatBlock;

 private:
  size_t size_ = 0;
  AlignedFloats data_;
};

// Activated.
inline float Opacity(const Splats& splats, size_t i) {
  return 1 / (1 + std::exp(-splats.at(i, kLogitOpacity)));
}
// The stored value of an opacity in (0, 1).
inline float LogitOf(double opacity) {
  return static_cast<float>(std::log(opacity / (1 - opacity)));
}

}  // namespace litags

#endif  // LITAGS_ENGINE_CORE_SPLATS_H_
