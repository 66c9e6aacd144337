// Cameras that the user brought: each with its photo, its photo's size and its photo's way up.
#ifndef LITAGS_ENGINE_PIPELINE_GIVEN_CAMERAS_H_
#define LITAGS_ENGINE_PIPELINE_GIVEN_CAMERAS_H_

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "engine/io/image_io.h"
#include "engine/io/sparse_model.h"
#include "engine/pipeline/engine.h"

namespace litags {

// The cameras in input.cameras_path of these photos (sorted names in input.images_dir), by name,
// else by stem (NameIndex), names that are the same first; the views get the photos' names and
// sizes. COLMAP ignores the EXIF orientation: cameras of a photo as stored are turned upright with
// it, unless input.cameras_are_upright. cameras_path is resolved (ResolveCameras).
// INVALID_ARGUMENT: NO_MATCHING_CAMERAS, CAMERA_AMBIGUOUS (its photo is one of several),
// DUPLICATE_CAMERA (of one photo), CAMERA_SIZE_MISMATCH, ORIENTATION_AMBIGUOUS (neither sizes nor
// Bundler's points tell whether a camera is of the photo as stored); errors of ReadCameras,
// ReadImageSize and CheckIntrinsics.
// `panoramas`: as PanoramaNames has it, by the photos' names.
absl::StatusOr<SparseModel> ReadGivenCameras(const ReconstructInput& input,
                                             const std::vector<std::string>& photos,
                                             std::vector<std::string>* notes,
                                             PanoramaNames* panoramas = nullptr);

// The error NO_MATCHING_CAMERAS. `photo`: one of the `photos`; `path`: of one that has a camera.
absl::Status NoMatchingCameras(size_t photos, std::string_view photo, std::string_view path);

// Whether the camera's picture has the shape of one of this size, to 2 %.
bool SameShape(const Camera& camera, int width, int height);

// Makes a camera one of its photo as it is upright: turned as EXIF says, if it is of the photo as
// stored, and scaled. `has_own_size`: its file says the camera's size, which tells what it is of.
// Returns by how many turns clockwise it was turned.
// INVALID_ARGUMENT: CAMERA_SIZE_MISMATCH, ORIENTATION_AMBIGUOUS.
absl::StatusOr<int> FitToPhoto(const std::string& name, const ImageInfo& photo, bool has_own_size,
                               Camera* camera, Distortion* distortion);

}  // namespace litags

#endif  // LITAGS_ENGINE_PIPELINE_GIVEN_CAMERAS_H_
