#include "engine/core/camera_spread.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>

#include "engine/core/quantile.h"

namespace litags {
namespace {

// A camera is far if it stands this many times as far from the middle as every camera that is not.
// Of 4,000 captures each of 8 to 100 cameras at random on a ring, a dome, a line, a plane, in a
// ball, on a walk, or coming nearer by powers of two, none has such a gap; of 6 on a line one in
// 2,000 has.
constexpr double kGap = 10;
constexpr size_t kLeastPlaces = 8;
// More than one in ten are no mistake: somebody took views from afar.
constexpr size_t kOneIn = 10;
// Radii of those that are not far: two that stand nearer to each other than this are another place.
constexpr double kAlone = 2;

double Distance(const std::array<double, 3>& a, const std::array<double, 3>& b) {
  return std::hypot(a[0] - b[0], a[1] - b[1], a[2] - b[2]);
}

// The places, and of each the index of the first that is the same up to rounding: the views of a
// panorama have one.
struct Distinct {
  std::vector<std::array<double, 3>> places;
  std::vector<size_t> index;
};

Distinct DistinctOf(absl::Span<const std::array<double, 3>> places) {
  constexpr double kRounding = 1e-9;  // of coordinates
  Distinct out;
  for (const auto& place : places) {
    const double rounding = kRounding * Distance(place, {0, 0, 0});
    const auto same = std::find_if(out.places.begin(), out.places.end(), [&](const auto& other) {
      return std::abs(place[0] - other[0]) <= rounding && Distance(place, other) <= rounding;
    });
    out.index.push_back(static_cast<size_t>(same - out.places.begin()));
    if (same == out.places.end()) out.places.push_back(place);
  }
  return out;
}

// Of places that are all different.
std::vector<bool> FarOf(absl::Span<const std::array<double, 3>> places) {
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
  std::vector<double> sorted = off;
  std::sort(sorted.begin(), sorted.end());
  size_t inside = n - 1 - std::max<size_t>(1, n / kOneIn);  // the last that is not far
  while (inside < n - 1 && sorted[inside + 1] <= kGap * sorted[inside]) ++inside;
  const double radius = sorted[inside];
  if (inside == n - 1 || radius <= 0) return far;
  for (size_t i = 0; i < n; ++i) {
    if (off[i] <= radius) continue;
    double nearest = std::numeric_limits<double>::infinity();
    for (size_t j = 0; j < n; ++j) {
      if (j != i) nearest = std::min(nearest, Distance(places[i], places[j]));
    }
    far[i] = nearest > kAlone * radius;
  }
  return far;
}

}  // namespace

std::vector<bool> FarPlaces(absl::Span<const std::array<double, 3>> places) {
  const Distinct distinct = DistinctOf(places);
  const std::vector<bool> far = FarOf(distinct.places);
  std::vector<bool> out;
  for (const size_t i : distinct.index) out.push_back(far[i]);
  return out;
}

std::vector<bool> FarCameras(absl::Span<const View> views) {
  std::vector<std::array<double, 3>> places;
  for (const View& view : views) places.push_back(view.camera.Center());
  return FarPlaces(places);
}

std::vector<View> NearViews(absl::Span<const View> views) {
  const std::vector<bool> far = FarCameras(views);
  std::vector<View> near;
  for (size_t i = 0; i < views.size(); ++i) {
    if (!far[i]) near.push_back(views[i]);
  }
  return near;
}

}  // namespace litags
