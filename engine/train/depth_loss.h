// The depth loss: 1 - Pearson correlation with a given depth map, over the whole map and over
// patches (LITA-GS L_depth). Blind to the map's scale and offset.
#ifndef LITAGS_ENGINE_TRAIN_DEPTH_LOSS_H_
#define LITAGS_ENGINE_TRAIN_DEPTH_LOSS_H_

#include <cstdint>
#include <vector>

#include "engine/train/losses.h"

namespace litags {

// The patches of one iteration: of 128 px (paper), clipped to the image; half as many as fit side
// by side (paper), at least one; at positions uniform over the image. A pure function of its
// arguments.
// Choice: the paper says "50% of the patches drawn anew"; they are placed freely, not on the
// grid, so that no pixel row is a patch border in every iteration.
std::vector<PixelRect> DrawDepthPatches(int width, int height, uint64_t seed, uint64_t iteration);

struct DepthLossTerms {  // both times the weight
  double global = 0;     // 1 - PCC of the whole map
  double local = 0;      // mean over patches of 1 - PCC; 0 without patches
  double Sum() const { return global + local; }
};

// LITA-GS Eq. 12.
// weight * loss of rendered [1, H, W] against target [1, H, W]; its gradient, weight * d(global +
// local)/d(rendered), is added to v_rendered (may be empty). `confidence` [1, H, W], >= 0, weighs
// every pixel in all sums (0 leaves it out; the target must be finite there too); empty: all ones.
// Where either map is constant there is no correlation: the term is 1 and has no gradient.
DepthLossTerms DepthLoss(PlanesView rendered, PlanesView target, PlanesView confidence,
                         const std::vector<PixelRect>& patches, double weight,
                         PlanesSpan v_rendered, LossWorkspace& ws);

}  // namespace litags

#endif  // LITAGS_ENGINE_TRAIN_DEPTH_LOSS_H_
