// How much work the rest of a run is, for estimates of its time.
#ifndef LITAGS_ENGINE_TRAIN_WORK_FORECAST_H_
#define LITAGS_ENGINE_TRAIN_WORK_FORECAST_H_

#include "engine/train/density_schedule.h"
#include "engine/train/pyramid.h"

namespace litags {

// Most that a density step of a growing scene is expected to multiply its Gaussians by: those of
// photos of 1600 px grew by 1.05 to 1.5.
inline constexpr double kGrowthOfStep = 1.25;

// Sums over iterations to come.
struct WorkForecast {
  double work = 0;       // ViewPyramid::WorkOf
  double gaussians = 0;  // of the scene
};

// Of the iterations [from, to) of a scene that has `gaussians` now and grows at density steps, as
// far as the level's photos allow, until growth ends.
WorkForecast ForecastWork(const ViewPyramid& pyramid, const DensitySchedule& density, int from,
                          int to, double gaussians);

}  // namespace litags

#endif  // LITAGS_ENGINE_TRAIN_WORK_FORECAST_H_
