#include "engine/core/splats.h"

#include <algorithm>

#include "engine/core/finite.h"

namespace litags {

void Splats::Resize(size_t n) {
  const size_t kept = std::min(n, size_);
  size_ = n;
  data_.resize(num_blocks() * kBlockFloats, 0.0f);
  // Lanes past the end stay zero.
  for (size_t i = kept; i < num_blocks() * kSplatBlock; ++i) {
    for (int row = 0; row < kSplatRows; ++row) at(i, row) = 0.0f;
  }
}

size_t Splats::FirstNotFinite() const {
  const size_t at = litags::FirstNotFinite(data_.data(), data_.size());
  if (at == data_.size()) return size_;
  return at / kBlockFloats * kSplatBlock + at % kSplatBlock;
}

void Splats::Copy(const Splats& source, size_t from, size_t to) {
  for (int row = 0; row < kSplatRows; ++row) at(to, row) = source.at(from, row);
}

}  // namespace litags
