#include "engine/stereo/agreement.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <vector>

#include "engine/core/pixel_at.h"
#include "engine/stereo/correlate.h"

namespace litags {
namespace {

constexpr double kTolerance = 0.02;  // of depth, within which two views agree
// Confidence grows from a correlation that counts for nothing to one that counts in full, and with
// the views that agree.
constexpr double kLeastFit = 0.2, kFullFit = 0.7;
constexpr int kFullViews = 2;

// Depth over the depth expected where pixel (x, y) of the view is seen by the other one; 0 if it
// is not.
double DepthRatio(const Transfer& t, const Surface& other, double x, double y,
                  double inverse_depth) {
  const std::array<double, 3> q = t.Project(x, y, inverse_depth);
  if (!(q[2] > 0)) return 0;
  const Planes& seen_by_other = other.inverse_depth;
  const std::optional<PixelIndex> pixel =
      PixelAt(q[0] / q[2], q[1] / q[2], seen_by_other.width, seen_by_other.height);
  if (!pixel.has_value()) return 0;
  const double expected = q[2] / inverse_depth;
  const double seen = seen_by_other.at(0, pixel->y, pixel->x);
  return 1 / (seen * expected);
}

}  // namespace

DepthMap Agree(const ViewSurface& view, absl::Span<const ViewSurface> others) {
  std::vector<Transfer> transfers;
  for (const ViewSurface& other : others) transfers.emplace_back(*view.camera, *other.camera);
  const Planes& inverse_depth = view.surface->inverse_depth;
  DepthMap map;
  map.depth = map.confidence = Planes(1, inverse_depth.height, inverse_depth.width);
  for (int y = 0; y < inverse_depth.height; ++y) {
    for (int x = 0; x < inverse_depth.width; ++x) {
      const double own = inverse_depth.at(0, y, x);
      double sum = 1;
      int agreeing = 0;
      for (size_t k = 0; k < others.size(); ++k) {
        const double ratio = DepthRatio(transfers[k], *others[k].surface, x + 0.5, y + 0.5, own);
        if (std::abs(ratio - 1) > kTolerance) continue;
        sum += ratio;
        ++agreeing;
      }
      const double fit = (view.surface->fit.at(0, y, x) - kLeastFit) / (kFullFit - kLeastFit);
      const double confidence =
          std::clamp(fit, 0.0, 1.0) * std::min(1.0, double(agreeing) / kFullViews);
      if (!(confidence > 0)) continue;
      map.depth.at(0, y, x) = static_cast<float>(sum / (1 + agreeing) / own);
      map.confidence.at(0, y, x) = static_cast<float>(confidence);
    }
  }
  return map;
}

}  // namespace litags
