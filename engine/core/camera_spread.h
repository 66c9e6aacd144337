// Where cameras stand, without the one that stands where no other does.
#ifndef LITAGS_ENGINE_CORE_CAMERA_SPREAD_H_
#define LITAGS_ENGINE_CORE_CAMERA_SPREAD_H_

#include <array>
#include <vector>

#include "absl/types/span.h"
#include "engine/core/camera.h"

namespace litags {

// Which of these places are far from all others: a tracker that lost itself, a photo of something
// else. The walk to a scene is not: each of its places is near the one before.
std::vector<bool> FarPlaces(absl::Span<const std::array<double, 3>> places);

// The places of these views' cameras but for the far ones.
std::vector<std::array<double, 3>> NearPlaces(absl::Span<const View> views);

}  // namespace litags

#endif  // LITAGS_ENGINE_CORE_CAMERA_SPREAD_H_
