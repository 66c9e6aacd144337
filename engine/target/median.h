// The median; for the sources of this folder only.
#ifndef LITAGS_ENGINE_TARGET_MEDIAN_H_
#define LITAGS_ENGINE_TARGET_MEDIAN_H_

#include <algorithm>
#include <utility>
#include <vector>

namespace litags {

// The upper of the two in the middle if there are two; reorders the values. 0 if there are none.
inline double MedianInPlace(std::vector<double>& values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + values.size() / 2;
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

inline double Median(std::vector<double> values) { return MedianInPlace(values); }

}  // namespace litags

#endif  // LITAGS_ENGINE_TARGET_MEDIAN_H_
