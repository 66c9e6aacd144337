// Robust fit of what several photos say of the same points of a scene.
#ifndef LITAGS_ENGINE_TARGET_TRACK_FIT_H_
#define LITAGS_ENGINE_TARGET_TRACK_FIT_H_

#include <array>
#include <cstddef>
#include <vector>

#include "absl/types/span.h"
#include "engine/core/cancel.h"

namespace litags {

// The number of coefficients that all values share.
inline constexpr int kTrackColumns = 4;

// What one photo says of one point: the point's own number + the photo's offset + the sum of
// columns[k] times coefficient k + noise.
struct TrackValue {
  int point = 0;
  int photo = 0;
  double value = 0;
  std::array<double, kTrackColumns> columns = {};  // 0: does not depend on that coefficient
};

// A quadratic function of the coefficients: x' information x / 2 - moment' x.
struct ColumnEquations {
  std::array<std::array<double, kTrackColumns>, kTrackColumns> information = {};
  std::array<double, kTrackColumns> moment = {};
};

struct TrackFit {
  std::vector<double> offsets;  // per photo; 0 of a photo without values. Their sum is near 0
  std::vector<double> errors;   // per photo: standard error of its offset from the mean
  std::vector<double> weights;  // per value, 0 (an outlier, or the point's only value) to 1
  double noise = 0;             // standard deviation of a value, as the median tells it
  ColumnEquations columns;      // with the points' numbers and the offsets eliminated
};

// Least squares with Tukey's weights, started from least absolute deviations: up to a third of the
// values may be wrong. A point that one photo sees says nothing. Offsets are drawn to 0 as if one
// value more said so. Values are finite and sorted by point (LITAGS_CHECK). Time grows with the
// cube of the photos (1,000: 1 to 2 s) and the square of a point's values, memory with the square
// of the photos. Once `cancel` is raised, the fit soon comes, and means nothing.
TrackFit FitTracks(size_t photos, absl::Span<const TrackValue> values,
                   const CancelToken& cancel = CancelToken());

// The equations of those values alone, with the weights and offsets of `fit`: group[i] says which
// of the `groups` results value i belongs to; a point's values are of one group.
std::vector<ColumnEquations> EquationsOfGroups(absl::Span<const TrackValue> values,
                                               const TrackFit& fit, absl::Span<const int> group,
                                               int groups);

}  // namespace litags

#endif  // LITAGS_ENGINE_TARGET_TRACK_FIT_H_
