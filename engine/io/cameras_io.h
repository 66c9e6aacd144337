// Cameras of other programs: which file or folder is meant, and what is in it.
#ifndef LITAGS_ENGINE_IO_CAMERAS_IO_H_
#define LITAGS_ENGINE_IO_CAMERAS_IO_H_

#include <string>
#include <string_view>

#include "absl/status/statusor.h"
#include "engine/io/sparse_model.h"
#include "engine/io/transforms_io.h"

namespace litags {

// What to read for `path`. For a folder without a COLMAP model: that of the models inside, or
// inside its folder sparse, which has most images, else its transforms.json; else `path` itself.
std::string ResolveCameras(const std::string& path);

// As ReadCameras of a resolved path. A JSON file that needs a size which `sizes` does not know is
// an error. `panoramas`: as PanoramaNames has it.
absl::StatusOr<SparseModel> ReadCamerasOf(const std::string& resolved, std::string_view field,
                                          const PhotoSizes& sizes,
                                          PanoramaNames* panoramas = nullptr);

}  // namespace litags

#endif  // LITAGS_ENGINE_IO_CAMERAS_IO_H_
