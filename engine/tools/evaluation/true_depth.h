// Depth maps of exact truth, as litags-sample --truth writes them.
#ifndef LITAGS_ENGINE_TOOLS_EVALUATION_TRUE_DEPTH_H_
#define LITAGS_ENGINE_TOOLS_EVALUATION_TRUE_DEPTH_H_

#include <optional>
#include <string>
#include <string_view>

#include "absl/status/statusor.h"
#include "engine/core/camera.h"
#include "engine/core/image.h"

namespace litags {

// DIR/STEM.{npy,pfm,png} of a view: depth along its axis, 0: none. Nothing where there is no such
// file. INVALID_ARGUMENT (SIZE_MISMATCH) if it is not of the camera's size; errors of ReadDepthMap.
absl::StatusOr<std::optional<Planes>> ReadTrueDepth(const std::string& dir, const View& view);

// The same of a view that must have one: INVALID_ARGUMENT (NO_TRUTH) naming `field` where there is
// no such file. `remedy` says what to do then.
absl::StatusOr<Planes> NeedTrueDepth(const std::string& dir, const View& view,
                                     std::string_view field, std::string_view remedy);

}  // namespace litags

#endif  // LITAGS_ENGINE_TOOLS_EVALUATION_TRUE_DEPTH_H_
