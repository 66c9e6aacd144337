#include "engine/train/camera_distance.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "absl/functional/function_ref.h"
#include "engine/core/parallel.h"
#include "engine/train/density.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/train/camera_distance.cc"
#include "hwy/foreach_target.h"  // IWYU pragma: keep
#include "hwy/highway.h"

HWY_BEFORE_NAMESPACE();
namespace litags {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// `squares` [kSplatBlock]: of the distances from the block's means to the nearest of the `count`
// centers, [x, y, z] each.
void SquaresToNearest(const float* HWY_RESTRICT block, const float* HWY_RESTRICT centers,
                      size_t count, float* HWY_RESTRICT squares) {
  const hn::CappedTag<float, kSplatBlock> d;
  for (size_t i = 0; i < kSplatBlock; i += hn::Lanes(d)) {
    const auto x = hn::Load(d, block + kMean * kSplatBlock + i),
               y = hn::Load(d, block + (kMean + 1) * kSplatBlock + i),
               z = hn::Load(d, block + (kMean + 2) * kSplatBlock + i);
    auto nearest = hn::Set(d, std::numeric_limits<float>::infinity());
    for (const float* center = centers; center != centers + 3 * count; center += 3) {
      const auto dx = hn::Sub(hn::Set(d, center[0]), x), dy = hn::Sub(hn::Set(d, center[1]), y),
                 dz = hn::Sub(hn::Set(d, center[2]), z);
      const auto square = hn::MulAdd(dz, dz, hn::MulAdd(dy, dy, hn::Mul(dx, dx)));
      nearest = hn::Min(nearest, square);
    }
    hn::Store(nearest, d, squares + i);
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace litags
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace litags {
namespace {

HWY_EXPORT(SquaresToNearest);

// Every place once: views of a panorama and photos of a rig share theirs.
std::vector<std::array<float, 3>> Places(Centers centers) {
  std::vector<std::array<float, 3>> places;
  for (const auto& [x, y, z] : centers) {
    places.push_back({static_cast<float>(x), static_cast<float>(y), static_cast<float>(z)});
  }
  std::sort(places.begin(), places.end());
  places.erase(std::unique(places.begin(), places.end()), places.end());
  return places;
}

// Calls visit(i, distance) for every Gaussian, with the distance from its mean to the nearest
// camera; from several threads.
void ForEachDistance(Centers centers, int threads, const Splats& splats,
                     absl::FunctionRef<void(size_t i, double distance)> visit) {
  const std::vector<std::array<float, 3>> places = Places(centers);
  ParallelFor(threads, splats.num_blocks(), [&](size_t block, int) {
    alignas(64) float squares[kSplatBlock];
    HWY_DYNAMIC_DISPATCH(SquaresToNearest)
    (splats.block(block), places.data()->data(), places.size(), squares);
    const size_t first = block * kSplatBlock, end = std::min(first + kSplatBlock, splats.size());
    for (size_t i = first; i < end; ++i) visit(i, std::sqrt(double{squares[i - first]}));
  });
}

}  // namespace

double DistanceQuantile(double q, Centers centers, int threads, const Splats& splats) {
  std::vector<double> distances(splats.size());
  ForEachDistance(centers, threads, splats,
                  [&](size_t i, double distance) { distances[i] = distance; });
  const auto at = distances.begin() + static_cast<ptrdiff_t>(q * distances.size());
  if (at == distances.end()) return 0;
  std::nth_element(distances.begin(), at, distances.end());
  return *at;
}

void PruneNearCameras(double least, Centers centers, int threads, Splats* splats) {
  ForEachDistance(centers, threads, *splats, [&](size_t i, double distance) {
    if (distance < least) splats->at(i, kLogitOpacity) = kInvisibleLogit;
  });
}

void LimitScales(double limit, Centers centers, int threads, Splats* splats) {
  ForEachDistance(centers, threads, *splats, [&](size_t i, double distance) {
    // A mean in a camera's very centre must give a number all the same.
    const auto most = static_cast<float>(std::log(limit * std::max(distance, 1e-7)));
    for (int row = kLogScale; row < kLogScale + 3; ++row) {
      splats->at(i, row) = std::min(splats->at(i, row), most);
    }
  });
}

}  // namespace litags
#endif  // HWY_ONCE
