#ifndef LITAGS_ENGINE_PIPELINE_TRAINING_LEG_H_
#define LITAGS_ENGINE_PIPELINE_TRAINING_LEG_H_

#include "engine/train/work_forecast.h"

namespace litags {

// Iterations in one go, without a roll-back between them, and what they took. Rates are of them.
struct TrainingLeg {
  double start = 0;  // MonotonicSeconds()
  int first = 0;     // iteration
  double work = 0;   // Trainer::LastWork() of its iterations
  double step_seconds = 0;
  double checkpoint_seconds = 0, checkpoint_gaussians = 0;  // sums over its checkpoints

  // That iterations of `work` take.
  double SecondsOfWork(double work) const;

  // That the iterations from `done` to `last` take, whose work is `forecast`. Iterations count by
  // their work, checkpoints by their Gaussians, all else (previews) as it was so far. `now` as
  // `start`; at least one iteration is done.
  double SecondsLeft(double now, int done, int last, const WorkForecast& forecast,
                     int checkpoint_every) const;
};

}  // namespace litags

#endif  // LITAGS_ENGINE_PIPELINE_TRAINING_LEG_H_
