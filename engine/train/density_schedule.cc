#include "engine/train/density_schedule.h"

#include <algorithm>
#include <utility>

#include "engine/train/camera_distance.h"

namespace litags {
namespace {

constexpr double kGrowthShare = 0.5;      // of the run, see recipe.densify_epochs. Choice
constexpr double kMostGrowthShare = 0.7;  // of short runs

// Quantile of the first Gaussians' distances that recipe.near_camera_pruning is a share of: a
// nearer one may be an outlier of the start. Choice
constexpr double kNearQuantile = 0.01;

int GrowthEndOf(const TrainOptions& options, size_t photos, int coarse_end) {
  const double most =
      std::clamp(options.recipe.densify_epochs * photos, kGrowthShare * options.iterations,
                 kMostGrowthShare * options.iterations);
  // In 64 bits: densify_until may be the largest int.
  const int64_t until = int64_t{coarse_end} + options.recipe.densify_until;
  return static_cast<int>(std::min(until, static_cast<int64_t>(most)));
}

}  // namespace

DensitySchedule::DensitySchedule(const TrainOptions& options,
                                 std::vector<std::array<double, 3>> centers, double extent,
                                 int coarse_end)
    : options_(options),
      centers_(std::move(centers)),
      extent_(extent),
      growth_end_(GrowthEndOf(options, centers_.size(), coarse_end)) {}

void DensitySchedule::Start(const Splats& initial) {
  if (options_.recipe.near_camera_pruning == 0) return;
  least_distance_ = options_.recipe.near_camera_pruning *
                    DistanceQuantile(kNearQuantile, centers_, options_.threads, initial);
}

bool DensitySchedule::IsDue(int done) const {
  return done >= options_.recipe.densify_start && done % options_.recipe.densify_every == 0;
}

void DensitySchedule::Step(int done, int64_t most_gaussians, SplatState* splats,
                           DensityStats* stats) const {
  if (least_distance_ > 0) {
    PruneNearCameras(least_distance_, centers_, options_.threads, &splats->params);
  }
  if (done <= growth_end_) {
    TrainOptions limited = options_;
    limited.max_gaussians = most_gaussians;
    ControlDensity(limited, extent_, done, splats, stats);
  }
  if (options_.recipe.max_scale > 0) {
    LimitScales(options_.recipe.max_scale, centers_, options_.threads, &splats->params);
  }
}

}  // namespace litags
