// Where cameras stand, without the one that stands where no other does.
#ifndef LITAGS_ENGINE_CORE_CAMERA_SPREAD_H_
#define LITAGS_ENGINE_CORE_CAMERA_SPREAD_H_

#include <array>
#include <vector>

#include "absl/types/span.h"
#include "engine/core/camera.h"

namespace litags {

// Which of these places are far from all others, as of a lost tracker or a photo of something else.
// None of fewer than eight, nor of a walk, whose places are each near the one before, nor where
// more than one in ten would be. Places that are the same, as of a panorama's views, are one.
std::vector<bool> FarPlaces(absl::Span<const std::array<double, 3>> places);

// Which of the views' cameras are far.
std::vector<bool> FarCameras(absl::Span<const View> views);

// The views but for those whose cameras are far.
std::vector<View> NearViews(absl::Span<const View> views);

}  // namespace litags

#endif  // LITAGS_ENGINE_CORE_CAMERA_SPREAD_H_
