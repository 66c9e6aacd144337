// Adaptive density control: where the picture needs more Gaussians, and which are not needed.
// Source: 3DGS Sec. 5, with a hard budget. How one Gaussian becomes two: growth.h.
#ifndef LITAGS_ENGINE_TRAIN_DENSITY_H_
#define LITAGS_ENGINE_TRAIN_DENSITY_H_

#include <cstdint>
#include <vector>

#include "engine/core/splats.h"
#include "engine/render/renderer.h"
#include "engine/train/options.h"

namespace litags {

// Logit of the opacity of a Gaussian that must not be seen: far below prune_opacity and 1/255.
constexpr float kInvisibleLogit = -10;

// Gaussians with their Adam moments; all three have one size.
struct SplatState {
  Splats params;
  Splats moment1;
  Splats moment2;

  // Keeps exactly the Gaussians `from` (indices into this; repeats make copies), in that order.
  void Rearrange(const std::vector<uint32_t>& from);

  void ClearMoments(size_t i);
};

// Sums over the views since the last density step that saw the Gaussian; index = Gaussian. Its
// score is grad / views.
struct DensityStats {
  std::vector<float> grad;   // |dL/dmean2d|, in units of half the larger side of image or mean crop
  std::vector<float> views;  // that saw it

  void Reset(size_t n);
  void Add(const ViewStats& view, double larger_side);
};

// One density step. Gaussians whose score exceeds recipe.densify_grad become two, as recipe.growth
// says, strongest first while the budget lasts. Nearly transparent ones and those with a parameter
// that is not finite are removed (the most opaque one stays if all are). All are put in Morton
// order, so that blocks of 16 are neighbours in space. Random numbers depend on (seed, iteration,
// Gaussian) only. Stats are reset.
void ControlDensity(const TrainOptions& options, double extent, int iteration, SplatState* state,
                    DensityStats* stats);

// Permutation that sorts the means along a Morton curve; ties by index.
std::vector<uint32_t> MortonOrder(const Splats& splats);

}  // namespace litags

#endif  // LITAGS_ENGINE_TRAIN_DENSITY_H_
