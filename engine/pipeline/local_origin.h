// Scenes in the coordinates of a map: Gaussians are floats, too coarse so far from the origin.
#ifndef LITAGS_ENGINE_PIPELINE_LOCAL_ORIGIN_H_
#define LITAGS_ENGINE_PIPELINE_LOCAL_ORIGIN_H_

#include <array>
#include <string>
#include <vector>

#include "engine/core/camera.h"
#include "engine/io/sparse_model.h"

namespace litags {

// Amid the cameras, where they stand a hundred times their distances from the origin; else 0. In
// whole units if the cameras are more than one apart.
std::array<double, 3> LocalOrigin(const std::vector<View>& views);

// Cameras and points as seen from another origin.
void TakeAsOrigin(const std::array<double, 3>& origin, SparseModel* model);

// What the user should know of it; `origin` is not 0.
std::string DescribeOrigin(const std::array<double, 3>& origin);

}  // namespace litags

#endif  // LITAGS_ENGINE_PIPELINE_LOCAL_ORIGIN_H_
