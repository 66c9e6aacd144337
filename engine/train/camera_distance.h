// How near Gaussians are to the cameras, and the limits that follow from it.
#ifndef LITAGS_ENGINE_TRAIN_CAMERA_DISTANCE_H_
#define LITAGS_ENGINE_TRAIN_CAMERA_DISTANCE_H_

#include <array>

#include "absl/types/span.h"
#include "engine/core/splats.h"

namespace litags {

// `centers` is where the cameras are: at least one; world. Distances are in single precision.
using Centers = absl::Span<const std::array<double, 3>>;

// Returns the quantile `q` of the distances from the Gaussians' means to the nearest camera, or 0
// without Gaussians.
double DistanceQuantile(double q, Centers centers, int threads, const Splats& splats);

// Makes Gaussians whose means are nearer than `least` to a camera invisible; ControlDensity, while
// it still runs, removes them.
void PruneNearCameras(double least, Centers centers, int threads, Splats* splats);

// Cuts every scale to `limit` times the distance from the Gaussian's mean to the nearest camera.
void LimitScales(double limit, Centers centers, int threads, Splats* splats);

}  // namespace litags

#endif  // LITAGS_ENGINE_TRAIN_CAMERA_DISTANCE_H_
