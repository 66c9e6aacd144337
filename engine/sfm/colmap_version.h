// Whether a program is a COLMAP that this module can run.
#ifndef LITAGS_ENGINE_SFM_COLMAP_VERSION_H_
#define LITAGS_ENGINE_SFM_COLMAP_VERSION_H_

#include <string>

#include "absl/status/statusor.h"
#include "engine/core/cancel.h"

namespace litags {

// The line in which `program help` names itself: "COLMAP 3.8 -- Structure-from-Motion ...".
// FAILED_PRECONDITION: COLMAP_UNSUPPORTED (not 3.8: other versions name options differently),
// COLMAP_BROKEN (no such line); errors of RunSubprocess. `timeout_seconds`: 0: 20 s, which is also
// the most.
absl::StatusOr<std::string> AskColmapVersion(const std::string& program, double timeout_seconds,
                                             const CancelToken& cancel);

}  // namespace litags

#endif  // LITAGS_ENGINE_SFM_COLMAP_VERSION_H_
