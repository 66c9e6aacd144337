// transforms.json of instant-ngp, NeRF and LOM: OpenGL cameras converted to ours, and back.
#ifndef LITAGS_ENGINE_IO_TRANSFORMS_IO_H_
#define LITAGS_ENGINE_IO_TRANSFORMS_IO_H_

#include <map>
#include <string>
#include <string_view>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "engine/io/sparse_model.h"

namespace litags {

// Parses a transforms.json. Intrinsics fl_x fl_y cx cy w h k1 k2 k3 p1 p2 stand at the top and may
// be overridden per frame; so may the lens: camera_model OPENCV_FISHEYE (or is_fisheye), with k1 to
// k4, FULL_OPENCV, with k1 to k6, and EQUIRECTANGULAR; without fl_x the focal length comes from
// camera_angle_x, without cx cy the principal point is the centre, without w h the size is its
// photo's. transform_matrix is camera-to-world, OpenGL axes (x right, y up, z backward); a uniform
// scale in it is divided out. The path of a view is its file_path. INVALID_ARGUMENT
// naming field, frame and key.
absl::StatusOr<SparseModel> ParseTransforms(std::string_view json, std::string_view field,
                                            const PhotoSizes& sizes,
                                            PanoramaNames* panoramas = nullptr);

// The same with one size for all photos.
absl::StatusOr<SparseModel> ParseTransforms(std::string_view json, std::string_view field,
                                            int default_width = 0, int default_height = 0);

// What frames have as mask_path, by their file_path, empty of those without; nothing for what is no
// such file.
std::map<std::string, std::string> MaskPathsOfTransforms(std::string_view json);

// The inverse; file_path is `image_folder`/name (or the name alone). Intrinsics that all views
// share stand at the top.
std::string FormatTransforms(const SparseModel& model, std::string_view image_folder);
absl::Status WriteTransforms(const std::string& path, const SparseModel& model,
                             std::string_view image_folder);

}  // namespace litags

#endif  // LITAGS_ENGINE_IO_TRANSFORMS_IO_H_
