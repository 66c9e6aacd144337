#include "engine/core/spread_indices.h"

#include <algorithm>
#include <cstdint>
#include <numeric>

namespace litags {
namespace {

// The fraction of i times the golden ratio, in units of 2^-32: no two of 2^32 are equal.
uint32_t GoldenFraction(size_t i) { return static_cast<uint32_t>(i) * 2654435769u; }

}  // namespace

std::vector<size_t> SpreadIndices(size_t count, size_t most) {
  std::vector<size_t> indices(count);
  std::iota(indices.begin(), indices.end(), size_t{0});
  if (count <= most) return indices;
  std::nth_element(indices.begin(), indices.begin() + most, indices.end(),
                   [](size_t a, size_t b) { return GoldenFraction(a) < GoldenFraction(b); });
  indices.resize(most);
  std::sort(indices.begin(), indices.end());
  return indices;
}

}  // namespace litags
