// Known cameras, perhaps with sparse points: what a transforms.json or a COLMAP model holds.
#ifndef LITAGS_ENGINE_IO_SPARSE_MODEL_H_
#define LITAGS_ENGINE_IO_SPARSE_MODEL_H_

#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "engine/core/camera.h"
#include "engine/core/color.h"
#include "engine/core/image.h"

namespace litags {

// A lens, as OpenCV has it. Where a point is seen that a pinhole camera of focal length 1 sees at
// (x, y), r from the middle:
// - radial and tangential (Brown-Conrady): (x, y) times (1 + k1 r^2 + k2 r^4 + k3 r^6) /
//   (1 + k4 r^2 + k5 r^4 + k6 r^6), and p1, p2;
// - fisheye (equidistant): at t (1 + k1 t^2 + k2 t^4 + k3 t^6 + k4 t^8) from the middle, where
//   t = atan r is the angle off the axis.
struct Distortion {
  double k1 = 0, k2 = 0;  // radial
  double p1 = 0, p2 = 0;  // tangential
  double k3 = 0, k4 = 0, k5 = 0, k6 = 0;
  bool fisheye = false;  // then p1, p2, k5 and k6 are 0

  std::array<double, 8> Coefficients() const { return {k1, k2, p1, p2, k3, k4, k5, k6}; }
  bool IsZero() const { return !fisheye && Coefficients() == std::array<double, 8>{}; }
  // Of a lens with more than k1 k2 p1 p2.
  bool IsFull() const { return k3 != 0 || k4 != 0 || k5 != 0 || k6 != 0; }
  bool IsFinite() const;
};

// How far from the middle a fisheye of focal length 1 puts an angle off its axis, radians.
double FisheyeRadius(const Distortion& lens, double angle);
// The angle that it puts at `radius`: where the curve first reaches it. Beyond where the curve
// stops rising, or `most`, that angle.
double FisheyeAngle(const Distortion& lens, double radius, double most);

// Where the point (x, y) is seen, both for focal length 1.
std::array<double, 2> Distort(const Distortion& lens, double x, double y);
// Where the point lies that is seen at (x, y). Nothing where the lens puts no point in front of it:
// beyond where its curve stops rising, and at what a fisheye sees beside and behind it.
std::optional<std::array<double, 2>> Undistort(const Distortion& lens, double x, double y);

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
  // Of each view, where the file that was read says that its photo lies; else empty.
  std::vector<std::string> paths;

  const std::string& PathOf(size_t view) const {
    return paths.empty() ? views[view].name : paths[view];
  }
};

// The size of the photo that a file of cameras calls `name`, for files that say none; 0x0: not
// known.
struct PhotoSize {
  int width = 0, height = 0;
};
using PhotoSizes = std::function<PhotoSize(const std::string& name)>;

// Names of views that are panoramas of the whole sphere: their cameras have a size and a place, and
// look along the panorama's middle. Readers that get none of these refuse panoramas.
using PanoramaNames = std::set<std::string>;

// Whether focal length and principal point are of a picture of the camera's size: not of one of
// another size, not in another unit. Not for panoramas. INVALID_ARGUMENT naming `where`:
// BAD_PRINCIPAL_POINT, BAD_FOCAL_LENGTH.
absl::Status CheckIntrinsics(const Camera& camera, std::string_view where);

// How far the distortion moves a pixel of the camera's picture at most, px.
double LargestShift(const Camera& camera, const Distortion& distortion);

// Removes lens distortion: the picture that the pinhole `camera` (same intrinsics) would have
// taken. Where the photo has no pixels its border is repeated: also where the lens's curve no
// longer rises, which it would show mirrored. INVALID_ARGUMENT if the sizes differ or a coefficient
// is not finite. ImageU8 or Photo.
template <typename T>
absl::StatusOr<Image<T>> Undistort(const Image<T>& image, const Camera& camera,
                                   const Distortion& distortion);

// Which pixels of that picture the photo has: a mask (engine/core/mask.h), empty if it has all.
absl::StatusOr<PlaneU8> MaskOfUndistorted(const Camera& camera, const Distortion& distortion);

// The same for what belongs to the photo's pixels and must not be mixed, [1, h, w] of any size of
// the photo's aspect ratio: nearest neighbours, 0 where the photo has no pixels.
absl::StatusOr<Planes> UndistortNearest(const Planes& plane, const Camera& camera,
                                        const Distortion& distortion);

}  // namespace litags

#endif  // LITAGS_ENGINE_IO_SPARSE_MODEL_H_
