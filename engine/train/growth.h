// How density control makes two Gaussians of one: a strategy of one file each.
#ifndef LITAGS_ENGINE_TRAIN_GROWTH_H_
#define LITAGS_ENGINE_TRAIN_GROWTH_H_

#include <array>
#include <cstddef>
#include <memory>

#include "engine/core/rng.h"
#include "engine/core/splats.h"
#include "engine/train/recipe.h"

namespace litags {

enum class Grown {
  kCloned,  // the Gaussian stays as it is
  kSplit,   // it changed, too
};

class GrowthStrategy {
 public:
  virtual ~GrowthStrategy() = default;

  // Makes Gaussian `i` and its copy at index `twin` of `splats` what follows Gaussian p of
  // `parents`, which is what i was. Random numbers depend on `rng` and i only.
  virtual Grown Grow(const Splats& parents, size_t p, size_t i, size_t twin, const CounterRng& rng,
                     Splats* splats) const = 0;
};

// Growth::kCloneSplit: 3DGS Sec. 5.2. Gaussians whose largest scale is at most `clone_scale`
// (world) are cloned in place, larger ones are split.
std::unique_ptr<GrowthStrategy> MakeCloneSplit(double clone_scale);

// Growth::kLongAxis: every Gaussian is split along its longest axis (arXiv 2411.10133, 2508.12313);
// the constants are ours.
std::unique_ptr<GrowthStrategy> MakeLongAxis();

// The recipe's; extent: of the scene, world.
std::unique_ptr<GrowthStrategy> MakeGrowth(const Recipe& recipe, double extent);

// Moves the mean of Gaussian i of `out` by `offset` along the axes of Gaussian p of `parent`, in
// units of its scales.
void MoveAlongAxes(const std::array<double, 3>& offset, const Splats& parent, size_t p, size_t i,
                   Splats* out);

}  // namespace litags

#endif  // LITAGS_ENGINE_TRAIN_GROWTH_H_
