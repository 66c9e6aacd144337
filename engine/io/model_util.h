// Inside this module: what every reader of cameras has to check and finish.
#ifndef LITAGS_ENGINE_IO_MODEL_UTIL_H_
#define LITAGS_ENGINE_IO_MODEL_UTIL_H_

#include <span>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "engine/io/sparse_model.h"

namespace litags {

// One camera on its way from a file: `view.name` is the path of its photo as the file has it,
// `source_id` the file's own number for it.
struct LoadedView {
  View view;
  Distortion distortion;
  size_t source_id = 0;
  bool panorama = false;
  bool has_size = false;  // by the file, not by its photo: the camera's numbers must fit it
};

// Checks every camera (has_size: CheckIntrinsics, too), name and coefficient, names views as their
// photos, sorts by name and refuses double paths. Photos of one name in several folders have these
// in their names, as NameIndex has it. `order`, if not null, receives the source ids in the order
// of the model's views; `panoramas`, if not null, the names of panoramas, which are refused
// otherwise.
absl::StatusOr<SparseModel> FinishModel(std::vector<LoadedView> views, std::string_view field,
                                        std::vector<size_t>* order,
                                        PanoramaNames* panoramas = nullptr);

// Of cameras, which may be of larger photos than those that come with them, px.
inline constexpr int kMaxCameraSide = 1 << 24;

// Whole numbers of pixels. INVALID_ARGUMENT (BAD_CAMERA_SIZE).
absl::Status SetSize(double width, double height, std::string_view where, Camera* camera);

// What the camera of a panorama of its size has for numbers that it has not: px a radian as focal
// length, and the middle.
void SetPanorama(Camera* camera);

// `rotation`: cam_from_world, row by row; the nearest rotation is taken, which is near
// (NOT_A_ROTATION). `center`: in the world.
absl::Status SetPlace(std::span<const double, 9> rotation, std::span<const double, 3> center,
                      std::string_view where, Camera* camera);

}  // namespace litags

#endif  // LITAGS_ENGINE_IO_MODEL_UTIL_H_
