#include "engine/train/density.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <numeric>
#include <optional>
#include <utility>

#include "engine/core/rng.h"
#include "engine/core/splats.h"
#include "engine/train/growth.h"

namespace litags {
namespace {

constexpr uint64_t kGrowthStream = 0x5350;  // random numbers of growth

bool IsFinite(const Splats& s, size_t i) {
  for (int row = 0; row < kSplatRows; ++row) {
    if (!std::isfinite(s.at(i, row))) return false;
  }
  return true;
}

// Worth keeping: opaque enough, and every parameter a number.
bool IsKept(const Splats& s, size_t i, double prune_opacity) {
  return IsFinite(s, i) && Opacity(s, i) >= prune_opacity;
}

// Of those that are finite; the first if none is.
uint32_t MostOpaque(const Splats& s) {
  std::optional<uint32_t> most;
  for (uint32_t i = 0; i < s.size(); ++i) {
    if (!IsFinite(s, i)) continue;
    if (!most.has_value() || s.at(i, kLogitOpacity) > s.at(*most, kLogitOpacity)) most = i;
  }
  return most.value_or(0);
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

void DensityStats::Add(const ViewStats& view, double larger_side) {
  const float to_half_image = static_cast<float>(0.5 * larger_side);
  for (size_t i = 0; i < grad.size(); ++i) {
    if (!view.visible[i]) continue;
    grad[i] += view.grad_means2d[i] * to_half_image;
    views[i] += 1;
  }
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

void ControlDensity(const TrainOptions& options, double extent, int iteration, SplatState* state,
                    DensityStats* stats) {
  const size_t n = state->params.size();
  const size_t budget =
      static_cast<size_t>(std::max<int64_t>(0, options.max_gaussians - int64_t(n)));
  const std::vector<uint32_t> growing = ChooseGrowing(*stats, options.recipe.densify_grad, budget);

  // Old Gaussians first, then a copy of each that grows.
  std::vector<uint32_t> from(n);
  std::iota(from.begin(), from.end(), 0);
  from.insert(from.end(), growing.begin(), growing.end());
  Splats parents(growing.size());
  for (size_t k = 0; k < growing.size(); ++k) parents.Copy(state->params, growing[k], k);
  state->Rearrange(from);
  const std::unique_ptr<GrowthStrategy> growth = MakeGrowth(options.recipe, extent);
  const CounterRng rng(options.seed, kGrowthStream + (uint64_t(iteration) << 16));
  for (size_t k = 0; k < growing.size(); ++k) {
    const uint32_t i = growing[k];
    state->ClearMoments(n + k);
    const Grown grown = growth->Grow(parents, k, i, n + k, rng, &state->params);
    if (grown == Grown::kSplit) state->ClearMoments(i);
  }

  // Prune and reorder in one pass over memory.
  std::vector<uint32_t> order = MortonOrder(state->params);
  std::erase_if(
      order, [&](uint32_t i) { return !IsKept(state->params, i, options.recipe.prune_opacity); });
  if (order.empty()) order.push_back(MostOpaque(state->params));  // a scene is never empty
  state->Rearrange(order);
  stats->Reset(order.size());
}

}  // namespace litags
