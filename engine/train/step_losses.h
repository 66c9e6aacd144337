#ifndef LITAGS_ENGINE_TRAIN_STEP_LOSSES_H_
#define LITAGS_ENGINE_TRAIN_STEP_LOSSES_H_

namespace litags {

// Losses of one iteration, weighted as they enter the total.
struct StepLosses {
  double exposure = 0;        // plain 3DGS: unused
  double reconstruction = 0;  // plain 3DGS: against the target
  double prior = 0;
  double depth = 0;
  double denoise = 0;    // MSE of the last two stages + TV
  bool skipped = false;  // the photo's turn was skipped (NaN recovery)

  double Total() const { return exposure + reconstruction + prior + depth + denoise; }
};

}  // namespace litags

#endif  // LITAGS_ENGINE_TRAIN_STEP_LOSSES_H_
