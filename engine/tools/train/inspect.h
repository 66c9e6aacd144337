// litags-train --inspect: what of a folder would be used, without training.
#ifndef LITAGS_ENGINE_TOOLS_TRAIN_INSPECT_H_
#define LITAGS_ENGINE_TOOLS_TRAIN_INSPECT_H_

#include <string>

#include "absl/status/statusor.h"
#include "engine/core/cancel.h"
#include "engine/pipeline/engine.h"

namespace litags {

// Plain text: a line for each photo that would be used (size, lens, light in stops from the middle
// photo, mask, camera), those left out and why, and what else there is to know. Writes found masks
// under work_dir. Errors of ScreenPhotos and ReadGivenCameras.
absl::StatusOr<std::string> InspectFolder(const ReconstructInput& input, int threads,
                                          const CancelToken& cancel);

// Why --strict refuses the folder: the first photo that cannot be read. Else OK.
absl::Status CheckAllReadable(const ReconstructInput& input, int threads,
                              const CancelToken& cancel);

}  // namespace litags

#endif  // LITAGS_ENGINE_TOOLS_TRAIN_INSPECT_H_
