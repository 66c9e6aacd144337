// When density control runs, and the limits that it keeps.
#ifndef LITAGS_ENGINE_TRAIN_DENSITY_SCHEDULE_H_
#define LITAGS_ENGINE_TRAIN_DENSITY_SCHEDULE_H_

#include <array>
#include <cstdint>
#include <vector>

#include "engine/core/splats.h"
#include "engine/train/density.h"
#include "engine/train/options.h"

namespace litags {

// Iterations of a run: until GrowthEnd() Gaussians are grown and removed. Near-camera pruning and
// limits of scale go on at every density step; then pruned Gaussians stay, invisible.
class DensitySchedule {
 public:
  // `centers`: of the cameras, one a photo; world. `extent`: of the scene; world. coarse_end: the
  // first iteration at full size.
  DensitySchedule(const TrainOptions& options, std::vector<std::array<double, 3>> centers,
                  double extent, int coarse_end);

  // The Gaussians that a run starts from, which set how near to a camera others may come.
  void Start(const Splats& initial);

  // Statistics of views are wanted before this iteration.
  int GrowthEnd() const { return growth_end_; }

  // True: Step is due after `done` iterations.
  bool IsDue(int done) const;

  // One density step, after which a scene that grows has at most most_gaussians.
  void Step(int done, int64_t most_gaussians, SplatState* splats, DensityStats* stats) const;

 private:
  TrainOptions options_;
  std::vector<std::array<double, 3>> centers_;
  double extent_;
  int growth_end_;
  double least_distance_ = 0;  // of Gaussians to the cameras; world
};

}  // namespace litags

#endif  // LITAGS_ENGINE_TRAIN_DENSITY_SCHEDULE_H_
