// Cameras of OpenMVG: sfm_data.json.
#ifndef LITAGS_ENGINE_IO_OPENMVG_IO_H_
#define LITAGS_ENGINE_IO_OPENMVG_IO_H_

#include <string_view>

#include "absl/status/statusor.h"
#include "engine/io/sparse_model.h"

namespace litags {

bool IsOpenMvg(std::string_view json);

// The views that have a pose. Lenses: pinhole, pinhole_radial_k1, _k3, pinhole_brown_t2 and
// fisheye, and spherical with `panoramas`, as PanoramaNames has it; others are refused by name
// (UNSUPPORTED_CAMERA_MODEL). OpenMVG counts pixels from their
// centres. INVALID_ARGUMENT naming field and view.
absl::StatusOr<SparseModel> ParseOpenMvg(std::string_view json, std::string_view field,
                                         PanoramaNames* panoramas = nullptr);

}  // namespace litags

#endif  // LITAGS_ENGINE_IO_OPENMVG_IO_H_
