#include "engine/pipeline/viewer_splats.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "engine/core/parallel.h"
#include "engine/core/splats.h"
#include "engine/render/constants.h"

namespace litags {
namespace {

// px, of what would have none left: invisible beside what viewers add, and the opacity makes up for
// it. Formats such as .spz do not hold much less.
constexpr double kLeastScale = 0.1;

// Scene units; 0 if no view sees the point.
double MeanPixelSize(const std::vector<View>& views, const std::array<double, 3>& point) {
  double sum = 0;
  int count = 0;
  for (const View& view : views) {
    const Camera& c = view.camera;
    const auto [x, y, z] = c.CamFromWorld(point);
    if (!(z > 0)) continue;
    const double px = c.fx * x / z + c.cx, py = c.fy * y / z + c.cy;
    if (px < 0 || py < 0 || px > c.width || py > c.height) continue;
    sum += z / std::sqrt(c.fx * c.fy);
    ++count;
  }
  return count > 0 ? sum / count : 0;
}

// `p`: size of a pixel, scene units. `added`: px^2.
void Dilatable(double p, PixelFilter trained, double added, size_t i, Splats* splats) {
  const double eps = trained == PixelFilter::kMip ? kMipEps2d : kEps2d;
  std::array<double, 3> growth;  // of the variances by viewers
  for (int k = 0; k < 3; ++k) {
    float& log_scale = splats->at(i, kLogScale + k);
    const double variance = std::exp(2.0 * log_scale);
    const double left =
        std::max(variance - (added - eps) * p * p, kLeastScale * kLeastScale * p * p);
    growth[k] = (left + added * p * p) / variance;
    log_scale = static_cast<float>(0.5 * std::log(left));
  }
  if (trained != PixelFilter::kMip) return;
  // The larger a scale, the less it grows.
  std::sort(growth.begin(), growth.end());
  float& logit = splats->at(i, kLogitOpacity);
  const double opacity =
      std::clamp(1 / ((1 + std::exp(-logit)) * std::sqrt(growth[0] * growth[1])), 1e-7, 1 - 1e-7);
  logit = LogitOf(opacity);
}

}  // namespace

Splats SplatsForViewers(const std::vector<View>& views, PixelFilter trained, float added,
                        Splats splats, int threads, const CancelToken& cancel) {
  ParallelFor(threads, splats.num_blocks(), [&](size_t block, int) {
    if (cancel.IsCancelled()) return;
    const size_t end = std::min(splats.size(), (block + 1) * kSplatBlock);
    for (size_t i = block * kSplatBlock; i < end; ++i) {
      const double p = MeanPixelSize(
          views, {splats.at(i, kMean), splats.at(i, kMean + 1), splats.at(i, kMean + 2)});
      if (p > 0) Dilatable(p, trained, added, i, &splats);
    }
  });
  return splats;
}

}  // namespace litags
