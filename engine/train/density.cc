#include "engine/train/density.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>

#include "absl/functional/function_ref.h"
#include "engine/core/parallel.h"
#include "engine/core/rng.h"

namespace litags {
namespace {

constexpr uint64_t kSplitStream = 0x5350;  // random numbers of splits
constexpr double kSplitShrink = 1.6;       // 3DGS: scales of both halves are divided by this

// Halves along the longest axis, relative to the whole. Their length and offset keep its variance
// there, 1/4 + 3/4. Choice
constexpr double kHalfLength = 0.5, kHalfOffset = 0.8660254;
constexpr double kHalfWidth = 0.9;    // of the other axes. Choice
constexpr double kHalfOpacity = 0.8;  // where halves overlap they cover more. Choice

float MaxScale(const Splats& s, size_t i) {
  return std::exp(std::max({s.at(i, kLogScale), s.at(i, kLogScale + 1), s.at(i, kLogScale + 2)}));
}

float Opacity(const Splats& s, size_t i) { return 1 / (1 + std::exp(-s.at(i, kLogitOpacity))); }

// Worth keeping: opaque enough, and every parameter a number.
bool IsKept(const Splats& s, size_t i, double prune_opacity) {
  for (int row = 0; row < kSplatRows; ++row) {
    if (!std::isfinite(s.at(i, row))) return false;
  }
  return Opacity(s, i) >= prune_opacity;
}

// Rotation matrix of the stored quaternion, row-major.
std::array<double, 9> Rotation(const Splats& s, size_t i) {
  double q[4], norm = 0;
  for (int k = 0; k < 4; ++k) {
    q[k] = s.at(i, kRawQuat + k);
    norm += q[k] * q[k];
  }
  norm = std::sqrt(std::max(norm, 1e-24));
  const double w = q[0] / norm, x = q[1] / norm, y = q[2] / norm, z = q[3] / norm;
  return {1 - 2 * (y * y + z * z), 2 * (x * y - w * z),     2 * (x * z + w * y),
          2 * (x * y + w * z),     1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
          2 * (x * z - w * y),     2 * (y * z + w * x),     1 - 2 * (x * x + y * y)};
}

// Moves the mean of Gaussian i by `offset` along the axes of Gaussian p of `parent`, in its scales.
void MoveBy(const std::array<double, 3>& offset, const Splats& parent, size_t p, size_t i,
            Splats* out) {
  const std::array<double, 9> rot = Rotation(parent, p);
  double local[3];
  for (int k = 0; k < 3; ++k) local[k] = std::exp(parent.at(p, kLogScale + k)) * offset[k];
  for (int k = 0; k < 3; ++k) {
    const double moved =
        rot[3 * k] * local[0] + rot[3 * k + 1] * local[1] + rot[3 * k + 2] * local[2];
    out->at(i, kMean + k) += static_cast<float>(moved);
  }
}

// Makes Gaussian i, a copy of Gaussian p of `parent`, a smaller one at a random place inside it.
void PlaceSplit(const Splats& parent, size_t p, const CounterRng& rng, uint64_t counter, size_t i,
                Splats* out) {
  MoveBy({rng.Normal(counter), rng.Normal(counter + 1), rng.Normal(counter + 2)}, parent, p, i,
         out);
  for (int k = 0; k < 3; ++k) {
    out->at(i, kLogScale + k) -= static_cast<float>(std::log(kSplitShrink));
  }
}

// Makes Gaussian i, a copy of Gaussian p of `parent`, its half on one side (1 or -1) of the middle
// of its longest axis.
void PlaceHalf(const Splats& parent, size_t p, double side, size_t i, Splats* out) {
  const float scales[3] = {parent.at(p, kLogScale), parent.at(p, kLogScale + 1),
                           parent.at(p, kLogScale + 2)};
  const auto longest = std::max_element(scales, scales + 3) - scales;
  std::array<double, 3> offset = {};
  offset[longest] = side * kHalfOffset;
  MoveBy(offset, parent, p, i, out);
  for (int k = 0; k < 3; ++k) {
    const double shrink = k == longest ? kHalfLength : kHalfWidth;
    out->at(i, kLogScale + k) += static_cast<float>(std::log(shrink));
  }
  const double opacity = kHalfOpacity * Opacity(parent, p);
  out->at(i, kLogitOpacity) = static_cast<float>(std::log(opacity / (1 - opacity)));
}

// The Gaussians to grow: score over the threshold, the `budget` largest of them.
std::vector<uint32_t> ChooseGrowing(const DensityStats& stats, double threshold, size_t budget) {
  std::vector<uint32_t> chosen;
  const auto score = [&](uint32_t i) { return stats.grad[i] / stats.views[i]; };
  for (uint32_t i = 0; i < stats.grad.size(); ++i) {
    if (stats.views[i] > 0 && score(i) > threshold) chosen.push_back(i);
  }
  if (chosen.size() > budget) {
    const auto stronger = [&](uint32_t a, uint32_t b) {
      return score(a) != score(b) ? score(a) > score(b) : a < b;
    };
    std::nth_element(chosen.begin(), chosen.begin() + budget, chosen.end(), stronger);
    chosen.resize(budget);
    std::sort(chosen.begin(), chosen.end());
  }
  return chosen;
}

constexpr float kClearLogit = -10;  // far from being seen

// Distance from the mean to the nearest of the points.
double ToNearest(absl::Span<const std::array<double, 3>> points, const Splats& splats, size_t i) {
  const double x = splats.at(i, kMean), y = splats.at(i, kMean + 1), z = splats.at(i, kMean + 2);
  double squared = std::numeric_limits<double>::infinity();
  for (const auto& p : points) {
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

void SplatState::Rearrange(const std::vector<uint32_t>& from) {
  for (Splats* s : {&params, &moment1, &moment2}) {
    Splats next(from.size());
    for (size_t i = 0; i < from.size(); ++i) next.Copy(*s, from[i], i);
    *s = std::move(next);
  }
}

void SplatState::ClearMoments(size_t i) {
  for (int row = 0; row < kSplatRows; ++row) {
    moment1.at(i, row) = 0;
    moment2.at(i, row) = 0;
  }
}

void DensityStats::Reset(size_t n) {
  grad.assign(n, 0);
  views.assign(n, 0);
}

void DensityStats::Add(const ViewStats& view, int width, int height) {
  const float to_half_image = 0.5f * std::max(width, height);
  for (size_t i = 0; i < grad.size(); ++i) {
    if (!view.visible[i]) continue;
    grad[i] += view.grad_means2d[i] * to_half_image;
    views[i] += 1;
  }
}

double DistanceQuantile(double q, absl::Span<const std::array<double, 3>> centers, int threads,
                        const Splats& splats) {
  std::vector<double> distances(splats.size());
  ForEachGaussian(threads, splats.size(),
                  [&](size_t i) { distances[i] = ToNearest(centers, splats, i); });
  const auto at = distances.begin() + static_cast<ptrdiff_t>(q * distances.size());
  if (at == distances.end()) return 0;
  std::nth_element(distances.begin(), at, distances.end());
  return *at;
}

void PruneNearCameras(double distance, absl::Span<const std::array<double, 3>> centers, int threads,
                      Splats* splats) {
  ForEachGaussian(threads, splats->size(), [&](size_t i) {
    if (ToNearest(centers, *splats, i) < distance) splats->at(i, kLogitOpacity) = kClearLogit;
  });
}

void LimitScales(double limit, absl::Span<const std::array<double, 3>> centers, int threads,
                 Splats* splats) {
  ForEachGaussian(threads, splats->size(), [&](size_t i) {
    // A mean in a camera's very centre must give a number all the same.
    const double nearest = std::max(ToNearest(centers, *splats, i), 1e-7);
    const auto most = static_cast<float>(std::log(limit * nearest));
    for (int row = kLogScale; row < kLogScale + 3; ++row) {
      splats->at(i, row) = std::min(splats->at(i, row), most);
    }
  });
}

std::vector<uint32_t> MortonOrder(const Splats& splats) {
  const size_t n = splats.size();
  float lo[3], hi[3];
  for (int k = 0; k < 3; ++k) {
    lo[k] = std::numeric_limits<float>::max();
    hi[k] = std::numeric_limits<float>::lowest();
    for (size_t i = 0; i < n; ++i) {
      lo[k] = std::min(lo[k], splats.at(i, kMean + k));
      hi[k] = std::max(hi[k], splats.at(i, kMean + k));
    }
  }
  constexpr int kBits = 16;
  std::vector<std::pair<uint64_t, uint32_t>> keyed(n);
  for (size_t i = 0; i < n; ++i) {
    uint64_t code = 0;
    for (int k = 0; k < 3; ++k) {
      const float span = std::max(hi[k] - lo[k], 1e-12f);
      const float unit = (splats.at(i, kMean + k) - lo[k]) / span;
      // Not clamp(): a mean that is not a number must give a cell all the same.
      const float inside = unit > 0 ? std::min(unit, 1.0f) : 0.0f;
      const auto cell = static_cast<uint64_t>(inside * ((1 << kBits) - 1));
      for (int b = 0; b < kBits; ++b) code |= ((cell >> b) & 1) << (3 * b + k);
    }
    keyed[i] = {code, static_cast<uint32_t>(i)};
  }
  std::sort(keyed.begin(), keyed.end());
  std::vector<uint32_t> order(n);
  for (size_t i = 0; i < n; ++i) order[i] = keyed[i].second;
  return order;
}

DensityReport ControlDensity(const TrainOptions& options, double extent, int iteration,
                             SplatState* state, DensityStats* stats) {
  DensityReport report;
  const size_t n = state->params.size();
  const size_t budget =
      static_cast<size_t>(std::max<int64_t>(0, options.max_gaussians - int64_t(n)));
  const std::vector<uint32_t> growing = ChooseGrowing(*stats, options.recipe.densify_grad, budget);

  // Old Gaussians first, then one new one for each that grows: a clone is a copy, splits and halves
  // move both the old and the new one.
  std::vector<uint32_t> from(n);
  std::iota(from.begin(), from.end(), 0);
  from.insert(from.end(), growing.begin(), growing.end());
  const Splats before = state->params;
  state->Rearrange(from);
  const CounterRng rng(options.seed, kSplitStream + (uint64_t(iteration) << 16));
  for (size_t k = 0; k < growing.size(); ++k) {
    const uint32_t old = growing[k];
    state->ClearMoments(n + k);
    const bool halves = options.recipe.growth == Growth::kLongAxis;
    if (!halves && MaxScale(before, old) <= options.recipe.densify_percent * extent) {
      ++report.cloned;
      continue;
    }
    ++report.split;
    state->ClearMoments(old);
    if (halves) {
      PlaceHalf(before, old, 1, old, &state->params);
      PlaceHalf(before, old, -1, n + k, &state->params);
    } else {
      PlaceSplit(before, old, rng, uint64_t{old} * 8, old, &state->params);
      PlaceSplit(before, old, rng, uint64_t{old} * 8 + 3, n + k, &state->params);
    }
  }

  // Prune and reorder in one pass over memory.
  std::vector<uint32_t> order = MortonOrder(state->params);
  const size_t grown = order.size();
  std::erase_if(
      order, [&](uint32_t i) { return !IsKept(state->params, i, options.recipe.prune_opacity); });
  if (order.empty()) order.push_back(0);  // a scene is never empty
  report.pruned = static_cast<int64_t>(grown - order.size());
  state->Rearrange(order);
  stats->Reset(order.size());
  return report;
}

}  // namespace litags
