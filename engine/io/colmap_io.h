// COLMAP's models: cameras.bin, images.bin, points3D.bin, or the same as .txt. Same axes as ours.
#ifndef LITAGS_ENGINE_IO_COLMAP_IO_H_
#define LITAGS_ENGINE_IO_COLMAP_IO_H_

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "engine/io/sparse_model.h"

namespace litags {

inline constexpr int64_t kMaxModelFileBytes = int64_t{2} << 30;  // a file of a model

// Reads the model in folder `dir`: the binary one, or, if there is none, that in text form. Camera
// models as docs/cameras.md has them. Tracks leave out sightings that no image has. NOT_FOUND if a
// file is missing; INVALID_ARGUMENT if one is truncated, holds impossible counts, an image without
// a camera, numbers that are not finite, or an image of another camera model.
absl::StatusOr<SparseModel> ReadColmapModel(const std::string& dir, std::string_view field);

// The same from the three files' bytes.
absl::StatusOr<SparseModel> ParseColmapModel(std::string_view cameras_bin,
                                             std::string_view images_bin,
                                             std::string_view points_bin, std::string_view field);
// The same in text form.
absl::StatusOr<SparseModel> ParseColmapText(std::string_view cameras_txt,
                                            std::string_view images_txt,
                                            std::string_view points_txt, std::string_view field);

// Checks a file of a model by itself, as its name says which: cameras.bin to points3D.txt. As
// ReadColmapModel, and, of cameras of which none passes, BAD_FOCAL_LENGTH and BAD_PRINCIPAL_POINT
// as CheckIntrinsics. What takes two files to see, as images of a camera that there is not, is left
// to ReadColmapModel. Returns the photos' names in images.bin or images.txt; of the others none.
absl::StatusOr<std::vector<std::string>> CheckColmapFile(std::string_view name,
                                                         std::string_view bytes,
                                                         std::string_view field);

// The model's three files, one camera per distinct set of intrinsics: PINHOLE without distortion,
// OPENCV_FISHEYE of a fisheye, FULL_OPENCV of a lens with more than k1 k2 p1 p2, else OPENCV. Image
// and point ids are index + 1.
struct ColmapFiles {
  std::string cameras, images, points;
};
absl::StatusOr<ColmapFiles> EncodeColmapModel(const SparseModel& model);

// Writes them to folder `dir`, which exists.
absl::Status WriteColmapModel(const std::string& dir, const SparseModel& model);

}  // namespace litags

#endif  // LITAGS_ENGINE_IO_COLMAP_IO_H_
