#include "engine/train/work_forecast.h"

#include <algorithm>

namespace litags {

double ForecastWork(const ViewPyramid& pyramid, const DensitySchedule& density, int from, int to,
                    double gaussians) {
  double work = 0;
  for (int i = from; i < to; ++i) {
    work += pyramid.WorkOf(i, gaussians);
    const int done = i + 1;
    if (!density.IsDue(done) || done > density.GrowthEnd()) continue;
    const auto most = static_cast<double>(pyramid.MostGaussians(pyramid.LevelOf(done)));
    gaussians = std::max(gaussians, std::min(most, kGrowthOfStep * gaussians));
  }
  return work;
}

}  // namespace litags
