// What the engine would refuse of a job's files, as far as their rows tell it: StartJob says it,
// where the user still is. What rows do not tell passes.
#ifndef LITAGS_SERVER_JOBS_START_CHECKS_H_
#define LITAGS_SERVER_JOBS_START_CHECKS_H_

#include <cstdint>
#include <vector>

#include "absl/status/statusor.h"
#include "engine/pipeline/options.h"
#include "server/store/job_store.h"

namespace litags {

// Returns the bytes without which the engine refuses the photos, whatever its number of threads; 0:
// not known. FAILED_PRECONDITION: TOO_FEW_PHOTOS, also of those that are not left out;
// VIDEO_NOT_ALONE, COLMAP_INCOMPLETE, DEPTH_MAPS_MISSING. INVALID_ARGUMENT: NO_MATCHING_CAMERAS,
// MASK_WITHOUT_PHOTO, MASK_AMBIGUOUS, MASK_TWICE, MASK_SIZE, DEPTH_MAP_WITHOUT_PHOTO,
// DEPTH_MAP_AMBIGUOUS, DEPTH_MAP_SIZE. RESOURCE_EXHAUSTED (MEMORY_EXCEEDED): the photos take more
// than `most_memory` (0: any).
absl::StatusOr<int64_t> CheckFiles(const std::vector<FileRecord>& files,
                                   const ReconstructOptions& options, int64_t most_memory);

}  // namespace litags

#endif  // LITAGS_SERVER_JOBS_START_CHECKS_H_
