#ifndef LITAGS_SERVER_API_CAMERA_PATH_H_
#define LITAGS_SERVER_API_CAMERA_PATH_H_

#include <vector>

#include "absl/status/statusor.h"
#include "engine/core/camera.h"
#include "engine/core/cancel.h"
#include "engine/pipeline/scene.h"
#include "litags/v1/render_service.pb.h"

namespace litags {

// The cameras of a path, one per frame; `lens` gives size and intrinsics. See RenderPathRequest.
// INVALID_ARGUMENT: PATH_MISSING, FRAMES_INVALID, TOO_FEW_KEYFRAMES, TOO_MANY_KEYFRAMES,
// ORBIT_INVALID and the errors of ResolvePose(); CANCELLED between two keyframes.
absl::StatusOr<std::vector<Camera>> ResolvePath(const v1::RenderPathRequest& request,
                                                const Camera& lens, const Scene& scene,
                                                const CancelToken& cancel = {});

}  // namespace litags

#endif  // LITAGS_SERVER_API_CAMERA_PATH_H_
