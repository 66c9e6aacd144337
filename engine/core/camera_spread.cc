#include "engine/core/camera_spread.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>

namespace litags {
namespace {

// Distances in units of the middle camera's from the middle of all. On a line, a ring or a dome all
// are within 2 of the middle; what is beyond 10, and 5 from every other, is not of that set.
constexpr double kFar = 10, kAlone = 5;
constexpr size_t kLeastPlaces = 4;  // of three, which one is far?

double Distance(const std::array<double, 3>& a, const std::array<double, 3>& b) {
  return std::hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]);
}

double Median(std::vector<double> values) {
  const auto middle = values.begin() + values.size() / 2;
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace

std::vector<bool> FarPlaces(absl::Span<const std::array<double, 3>> places) {
  const size_t n = places.size();
  std::vector<bool> far(n, false);
  if (n < kLeastPlaces) return far;
  std::array<double, 3> middle;
  for (int k = 0; k < 3; ++k) {
    std::vector<double> along;
    for (const auto& place : places) along.push_back(place[k]);
    middle[k] = Median(std::move(along));
  }
  std::vector<double> off;
  for (const auto& place : places) off.push_back(Distance(place, middle));
  const double unit = Median(off);
  if (!(unit > 0)) return far;  // half of them stand in one place
  for (size_t i = 0; i < n; ++i) {
    if (off[i] <= kFar * unit) continue;
    double nearest = std::numeric_limits<double>::infinity();
    for (size_t j = 0; j < n; ++j) {
      if (j != i) nearest = std::min(nearest, Distance(places[i], places[j]));
    }
    far[i] = nearest > kAlone * unit;
  }
  return far;
}

std::vector<std::array<double, 3>> NearPlaces(absl::Span<const View> views) {
  std::vector<std::array<double, 3>> places, near;
  for (const View& view : views) places.push_back(view.camera.Center());
  const std::vector<bool> far = FarPlaces(places);
  for (size_t i = 0; i < places.size(); ++i) {
    if (!far[i]) near.push_back(places[i]);
  }
  return near;
}

}  // namespace litags
