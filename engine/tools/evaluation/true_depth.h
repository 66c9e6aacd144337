// Depth maps of exact truth, as litags-sample --truth writes them.
#ifndef LITAGS_ENGINE_TOOLS_EVALUATION_TRUE_DEPTH_H_
#define LITAGS_ENGINE_TOOLS_EVALUATION_TRUE_DEPTH_H_

#include <optional>
#include <string>

#include "absl/status/statusor.h"
#include "engine/core/camera.h"
#include "engine/core/image.h"

namespace litags {

// DIR/STEM.{npy,pfm,png} of a view: depth along its axis, 0: none. Nothing where there is no such
// file. INVALID_ARGUMENT (SIZE_MISMATCH) if it is not of the camera's size; errors of ReadDepthMap.
absl::StatusOr<std::optional<Planes>> ReadTrueDepth(const std::string& dir, const View& view);

}  // namespace litags

#endif  // LITAGS_ENGINE_TOOLS_EVALUATION_TRUE_DEPTH_H_
