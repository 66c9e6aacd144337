#include "engine/pipeline/training_leg.h"

namespace litags {

double TrainingLeg::SecondsOfWork(double of_work) const { return step_seconds / work * of_work; }

double TrainingLeg::SecondsLeft(double now, int done, int last, const WorkForecast& forecast,
                                int checkpoint_every) const {
  const double beside = now - start - step_seconds - checkpoint_seconds;
  double seconds = SecondsOfWork(forecast.work) + beside / (done - first) * (last - done);
  if (checkpoint_gaussians > 0) {
    seconds += checkpoint_seconds / checkpoint_gaussians * forecast.gaussians / checkpoint_every;
  }
  return seconds;
}

}  // namespace litags
