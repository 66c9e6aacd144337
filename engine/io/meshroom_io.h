// Cameras of Meshroom (AliceVision): cameras.sfm and other JSON files of its SfMData.
#ifndef LITAGS_ENGINE_IO_MESHROOM_IO_H_
#define LITAGS_ENGINE_IO_MESHROOM_IO_H_

#include <string_view>

#include "absl/status/statusor.h"
#include "engine/io/sparse_model.h"

namespace litags {

bool IsMeshroom(std::string_view json);

// The views that have a pose. Lenses: pinhole, radial1 and radial3, in the files' versions from
// 1.0 on; others are refused by name (UNSUPPORTED_CAMERA_MODEL), as views of rigs are. Like
// OpenMVG, which it comes from, it counts pixels from their centres. INVALID_ARGUMENT naming field
// and view.
absl::StatusOr<SparseModel> ParseMeshroom(std::string_view json, std::string_view field);

}  // namespace litags

#endif  // LITAGS_ENGINE_IO_MESHROOM_IO_H_
