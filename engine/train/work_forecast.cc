#include "engine/train/work_forecast.h"

#include <algorithm>

namespace litags {

WorkForecast ForecastWork(const ViewPyramid& pyramid, const DensitySchedule& density, int from,
                          int to, double gaussians) {
  WorkForecast sum;
  for (int i = from; i < to; ++i) {
    sum.work += pyramid.WorkOf(i, gaussians);
    sum.gaussians += gaussians;
    const int done = i + 1;
    if (!density.IsDue(done) || done > density.GrowthEnd()) continue;
    const auto most = static_cast<double>(pyramid.MostGaussians(pyramid.LevelOf(done)));
    gaussians = std::max(gaussians, std::min(most, kGrowthOfStep * gaussians));
  }
  return sum;
}

}  // namespace litags
