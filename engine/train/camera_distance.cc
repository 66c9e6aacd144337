#include "engine/train/camera_distance.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "absl/functional/function_ref.h"
#include "engine/core/parallel.h"
#include "engine/train/density.h"

namespace litags {
namespace {

// Distance from the mean to the nearest camera.
double ToNearest(Centers centers, const Splats& splats, size_t i) {
  const double x = splats.at(i, kMean), y = splats.at(i, kMean + 1), z = splats.at(i, kMean + 2);
  double squared = std::numeric_limits<double>::infinity();
  for (const auto& p : centers) {
    const double dx = p[0] - x, dy = p[1] - y, dz = p[2] - z;
    squared = std::min(squared, dx * dx + dy * dy + dz * dz);
  }
  return std::sqrt(squared);
}

void ForEachGaussian(int threads, size_t count, absl::FunctionRef<void(size_t i)> visit) {
  ParallelFor(threads, (count + kSplatBlock - 1) / kSplatBlock, [&](size_t block, int) {
    const size_t first = block * kSplatBlock, end = std::min(first + kSplatBlock, count);
    for (size_t i = first; i < end; ++i) visit(i);
  });
}

}  // namespace

double DistanceQuantile(double q, Centers centers, int threads, const Splats& splats) {
  std::vector<double> distances(splats.size());
  ForEachGaussian(threads, splats.size(),
                  [&](size_t i) { distances[i] = ToNearest(centers, splats, i); });
  const auto at = distances.begin() + static_cast<ptrdiff_t>(q * distances.size());
  if (at == distances.end()) return 0;
  std::nth_element(distances.begin(), at, distances.end());
  return *at;
}

void PruneNearCameras(double distance, Centers centers, int threads, Splats* splats) {
  ForEachGaussian(threads, splats->size(), [&](size_t i) {
    if (ToNearest(centers, *splats, i) < distance) splats->at(i, kLogitOpacity) = kInvisibleLogit;
  });
}

void LimitScales(double limit, Centers centers, int threads, Splats* splats) {
  ForEachGaussian(threads, splats->size(), [&](size_t i) {
    // A mean in a camera's very centre must give a number all the same.
    const double nearest = std::max(ToNearest(centers, *splats, i), 1e-7);
    const auto most = static_cast<float>(std::log(limit * nearest));
    for (int row = kLogScale; row < kLogScale + 3; ++row) {
      splats->at(i, row) = std::min(splats->at(i, row), most);
    }
  });
}

}  // namespace litags
