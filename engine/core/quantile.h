// Quantiles and medians.
#ifndef LITAGS_ENGINE_CORE_QUANTILE_H_
#define LITAGS_ENGINE_CORE_QUANTILE_H_

#include <algorithm>
#include <cstddef>
#include <vector>

namespace litags {

// The value that `share`, [0, 1], of the others lie below; reorders the values. 0 if there are
// none.
template <class T>
T QuantileInPlace(std::vector<T>& values, double share) {
  if (values.empty()) return 0;
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(share * (values.size() - 1));
  std::nth_element(values.begin(), at, values.end());
  return *at;
}

// The upper of the two in the middle if there are two; reorders the values. 0 if there are none.
template <class T>
T MedianInPlace(std::vector<T>& values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + values.size() / 2;
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

template <class T>
T Median(std::vector<T> values) {
  return MedianInPlace(values);
}

// Standard deviation of a normal distribution about 0 by the median of magnitudes of its values,
// which outliers hardly move; reorders them. 0 if there are none.
template <class T>
T DeviationFromMagnitudes(std::vector<T>& magnitudes) {
  return MedianInPlace(magnitudes) / T(0.6745);  // the normal distribution's third quartile
}

}  // namespace litags

#endif  // LITAGS_ENGINE_CORE_QUANTILE_H_
