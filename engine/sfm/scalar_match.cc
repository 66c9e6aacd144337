#include "engine/sfm/scalar_match.h"

#include <algorithm>
#include <cmath>

namespace litags {
namespace {

size_t Count(const Descriptors& all) { return all.size() / kDescriptorSize; }

// The match of each of `of`; -1: none.
std::vector<int> MatchesOneWay(const Descriptors& of, const Descriptors& in,
                               const MatchRule& rule) {
  const NearestProducts nearest = ScalarNearest(of, in, 0);
  const auto distance = [](int32_t product) {
    return std::acos(std::min(product / (512.0f * 512.0f), 1.0f));
  };
  std::vector<int> matches(Count(of), -1);
  for (size_t i = 0; i < Count(of); ++i) {
    const float d = distance(nearest.best[i]);
    if (nearest.index[i] < 0 || d > rule.max_distance) continue;
    if (d >= rule.max_ratio * distance(nearest.second[i])) continue;
    matches[i] = nearest.index[i];
  }
  return matches;
}

}  // namespace

int32_t Product(const Descriptors& a, size_t i, const Descriptors& b, size_t j) {
  int32_t sum = 0;
  for (size_t k = 0; k < kDescriptorSize; ++k) {
    sum += a[i * kDescriptorSize + k] * b[j * kDescriptorSize + k];
  }
  return sum;
}

NearestProducts ScalarNearest(const Descriptors& of, const Descriptors& in, int32_t floor) {
  NearestProducts nearest;
  for (size_t i = 0; i < Count(of); ++i) {
    int32_t best = floor, second = floor, index = -1;
    for (size_t j = 0; j < Count(in); ++j) {
      const int32_t product = Product(of, i, in, j);
      if (product > best) {
        second = best;
        best = product;
        index = static_cast<int32_t>(j);
      } else {
        second = std::max(second, product);
      }
    }
    nearest.best.push_back(best);
    nearest.second.push_back(second);
    nearest.index.push_back(index);
  }
  return nearest;
}

std::vector<FeatureMatch> ScalarMatches(const Descriptors& a, const Descriptors& b,
                                        const MatchRule& rule) {
  const std::vector<int> ab = MatchesOneWay(a, b, rule), ba = MatchesOneWay(b, a, rule);
  std::vector<FeatureMatch> matches;
  for (size_t i = 0; i < ab.size(); ++i) {
    if (ab[i] < 0 || ba[static_cast<size_t>(ab[i])] != static_cast<int>(i)) continue;
    matches.push_back({static_cast<uint32_t>(i), static_cast<uint32_t>(ab[i])});
  }
  return matches;
}

}  // namespace litags
