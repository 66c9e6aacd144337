// Smooth paths of cameras, for videos.
#ifndef LITAGS_ENGINE_CORE_CAMERA_PATH_H_
#define LITAGS_ENGINE_CORE_CAMERA_PATH_H_

#include <vector>

#include "engine/core/camera.h"

namespace litags {

// `frames` cameras with the size and intrinsics of `lens`, evenly spaced in keys: centres on a
// Catmull-Rom curve through those of `keys`, rotations by spherical interpolation. An open path
// begins at the first key and ends at the last; a closed one goes on to the first, which it does
// not show again. At least two keys.
std::vector<Camera> PathThrough(const std::vector<Camera>& keys, int frames, bool closed,
                                const Camera& lens);

}  // namespace litags

#endif  // LITAGS_ENGINE_CORE_CAMERA_PATH_H_
