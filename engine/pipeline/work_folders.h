// A run clears and fills folders in its work_dir: what the user gave must not lie there.
#ifndef LITAGS_ENGINE_PIPELINE_WORK_FOLDERS_H_
#define LITAGS_ENGINE_PIPELINE_WORK_FOLDERS_H_

#include <string>

#include "absl/status/status.h"
#include "absl/strings/string_view.h"
#include "absl/types/span.h"
#include "engine/pipeline/engine.h"

namespace litags {

// That none of `inputs` (files or folders; empty ones are none) is, or lies in, a folder of
// `work_dir` of these names. INVALID_ARGUMENT (INPUT_IN_WORK_DIR).
absl::Status CheckOutside(const std::string& work_dir, absl::Span<const absl::string_view> folders,
                          absl::Span<const std::string> inputs);

// The same of all that a run reads and all that it clears.
absl::Status CheckInputsOutside(const ReconstructInput& input);

}  // namespace litags

#endif  // LITAGS_ENGINE_PIPELINE_WORK_FOLDERS_H_
