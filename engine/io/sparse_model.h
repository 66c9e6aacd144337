// Known cameras, perhaps with sparse points: what a transforms.json or a COLMAP model holds.
#ifndef LITAGS_ENGINE_IO_SPARSE_MODEL_H_
#define LITAGS_ENGINE_IO_SPARSE_MODEL_H_

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "engine/core/camera.h"
#include "engine/core/image.h"
#include "engine/core/photo.h"

namespace litags {

// Brown-Conrady lens distortion, OpenCV's first four coefficients.
struct Distortion {
  double k1 = 0, k2 = 0;  // radial
  double p1 = 0, p2 = 0;  // tangential

  bool IsZero() const { return k1 == 0 && k2 == 0 && p1 == 0 && p2 == 0; }
};

// Where a point was seen: index into SparseModel::views and position in that photo, px.
struct TrackElement {
  int view = 0;
  double x = 0, y = 0;
};

struct SparsePoint {
  std::array<double, 3> xyz = {0, 0, 0};   // world
  std::array<uint8_t, 3> rgb = {0, 0, 0};  // sRGB
  double error = 0;                        // mean reprojection error, px; < 0 if unknown
  std::vector<TrackElement> track;

  int track_length() const { return static_cast<int>(track.size()); }
};

struct SparseModel {
  std::vector<View> views;              // sorted by name, names unique
  std::vector<Distortion> distortions;  // one per view: of the photo as it was taken
  std::vector<SparsePoint> points;      // empty for transforms.json
};

// Reads a transforms*.json file or a COLMAP binary model folder, whichever `path` is. Errors start
// with `field`. `default_width/height`: photo size for JSON files that give none (0: then an
// error).
absl::StatusOr<SparseModel> ReadCameras(const std::string& path, std::string_view field,
                                        int default_width = 0, int default_height = 0);

// How far the distortion moves a pixel of the camera's picture at most, px.
double LargestShift(const Camera& camera, const Distortion& distortion);

// Removes lens distortion: the picture that the pinhole `camera` (same intrinsics) would have
// taken. Where the photo has no pixels its border is repeated. INVALID_ARGUMENT if the sizes differ
// or a coefficient is not finite.
// ImageU8 or Photo.
template <typename T>
absl::StatusOr<Image<T>> Undistort(const Image<T>& image, const Camera& camera,
                                   const Distortion& distortion);

// The same for what belongs to the photo's pixels and must not be mixed, [1, h, w] of any size of
// the photo's aspect ratio: nearest neighbours, 0 where the photo has no pixels.
absl::StatusOr<Planes> UndistortNearest(const Planes& plane, const Camera& camera,
                                        const Distortion& distortion);

}  // namespace litags

#endif  // LITAGS_ENGINE_IO_SPARSE_MODEL_H_
