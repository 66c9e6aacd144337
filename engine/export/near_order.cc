#include "engine/export/near_order.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace litags {
namespace {

constexpr int kBits = 21;          // an axis
constexpr double kOutside = 0.01;  // of the Gaussians, half of them on either side

// The box along an axis: where it begins and how wide it is.
std::pair<double, double> BoxOf(std::vector<float> values) {
  std::erase_if(values, [](float v) { return !std::isfinite(v); });
  if (values.empty()) return {0, 1};
  const auto left_out = static_cast<ptrdiff_t>(0.5 * kOutside * double(values.size()));
  const auto low = values.begin() + left_out, high = values.end() - 1 - left_out;
  std::nth_element(values.begin(), low, values.end());
  const double least = *low;
  std::nth_element(low, high, values.end());
  const double inner = std::max(*high - least, 1e-12);
  return {least - 0.5 * inner, 2 * inner};
}

}  // namespace

std::vector<uint32_t> NearOrder(const Splats& splats) {
  const size_t n = splats.size();
  std::vector<std::pair<uint64_t, uint32_t>> keyed(n);
  for (size_t i = 0; i < n; ++i) keyed[i].second = static_cast<uint32_t>(i);
  std::vector<float> values(n);
  for (int k = 0; k < 3; ++k) {
    for (size_t i = 0; i < n; ++i) values[i] = splats.at(i, kMean + k);
    const auto [begin, width] = BoxOf(values);
    for (size_t i = 0; i < n; ++i) {
      const double unit = (values[i] - begin) / width;
      // Not clamp(): a mean that is not a number must give a cell all the same.
      const double inside = unit > 0 ? std::min(unit, 1.0) : 0.0;
      const auto cell = static_cast<uint64_t>(inside * ((1 << kBits) - 1));
      for (int b = 0; b < kBits; ++b) keyed[i].first |= ((cell >> b) & 1) << (3 * b + k);
    }
  }
  std::sort(keyed.begin(), keyed.end());
  std::vector<uint32_t> order(n);
  for (size_t i = 0; i < n; ++i) order[i] = keyed[i].second;
  return order;
}

}  // namespace litags
