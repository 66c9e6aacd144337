// Where the cameras of a capture come from: the user, an earlier run of this job, or COLMAP.
#ifndef LITAGS_ENGINE_PIPELINE_CAMERA_SOURCE_H_
#define LITAGS_ENGINE_PIPELINE_CAMERA_SOURCE_H_

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "engine/io/mask_io.h"
#include "engine/io/sparse_model.h"
#include "engine/pipeline/context.h"

namespace litags {

// Cameras and points of the photos in input.images_dir. They are kept in work_dir/cameras, found
// ones with a wide fisheye in SolvedFisheyes(), and taken from there if they were found from the
// same files, `masks` of photos among them. View names
// are names of photos there; sizes are those of the photo files. Fills photos, registered, dropped,
// sfm_preparation and notes of the report. Errors of FindCameras, TriangulatePoints and
// ReadGivenCameras; SFM_TOO_FEW_REGISTERED for kept cameras, too.
absl::StatusOr<SparseModel> ObtainCameras(const Context& context,
                                          const std::vector<std::string>& photos,
                                          const MaskPaths& masks, const std::string& colmap);

// A folder in work_dir; a COLMAP model.
std::string SolvedFisheyes(const ReconstructInput& input);

}  // namespace litags

#endif  // LITAGS_ENGINE_PIPELINE_CAMERA_SOURCE_H_
