// How far the exposure rule is from the truth of a benchmark scene.
#ifndef LITAGS_ENGINE_TOOLS_BENCH_EXPOSURE_SCENE_H_
#define LITAGS_ENGINE_TOOLS_BENCH_EXPOSURE_SCENE_H_

#include <string>

#include "absl/status/statusor.h"

namespace litags {

// The rule's gain for the photos SCENE/`light`, all of one exposure, over the gain that brings
// their pixels, but for clipped ones, nearest to SCENE/high in PSNR; stops. Photos count that both
// folders have by name.
// INVALID_ARGUMENT (NO_PAIRS) if there are none; errors of ReadPhoto.
absl::StatusOr<double> ExposureErrorOfScene(const std::string& scene, const std::string& light);

}  // namespace litags

#endif  // LITAGS_ENGINE_TOOLS_BENCH_EXPOSURE_SCENE_H_
