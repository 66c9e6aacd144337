// Gaussians on their way into a file: what every writer gets, and what can be done to it before.
#ifndef LITAGS_ENGINE_EXPORT_VIEWER_SCENE_H_
#define LITAGS_ENGINE_EXPORT_VIEWER_SCENE_H_

#include <array>
#include <cstdint>
#include <vector>

#include "absl/status/status.h"
#include "engine/core/camera.h"
#include "engine/core/cancel.h"
#include "engine/core/splats.h"
#include "engine/export/export_request.h"
#include "engine/render/renderer.h"

namespace litags {

using Matrix3 = std::array<double, 9>;  // row-major

struct ViewerScene {
  Splats splats;  // LITA attributes mean nothing here
  int sh_degree = kMaxShDegree;
  float near_plane = RenderSettings().near_plane;  // that it was trained with
  bool antialiased = false;           // to be drawn as PixelFilter::kMip does, else as kDilate
  UpAxis up = UpAxis::kKeep;          // which axis is up now; kKeep: unknown
  std::array<double, 3> origin = {};  // that positions and views count from
  std::vector<View> views;            // the photos' cameras
  // What they look at, counted from the origin: the middle, the mean distance from there, and which
  // direction, of unit length, is up.
  std::array<double, 3> center = {}, up_direction = {0, -1, 0};
  double radius = 1;
  CancelToken cancel;  // that writers which take long look at
};

// Coefficients of a colour, the one of degree 0 included.
constexpr int ShCount(int degree) { return (degree + 1) * (degree + 1); }

// Of unit length, wxyz.
std::array<float, 4> UnitQuat(const Splats& splats, size_t i);

// Turns the Gaussians: x becomes R x, their shapes and colours with them. Exact for every degree.
// `threads` <= 0: all cores.
void Rotate(const Matrix3& rotation, Splats* splats, int threads = 0);

// Turns everything so that `up`, of unit length, becomes `axis`, by the smallest angle; then
// multiplies all lengths by `scale`. `threads` <= 0: all cores.
void PlaceScene(const std::array<double, 3>& up, UpAxis axis, double scale, ViewerScene* scene,
                int threads = 0);

// The rotation by the smallest angle that makes `up`, of unit length, the axis; none for kKeep.
Matrix3 RotationTo(const std::array<double, 3>& up, UpAxis axis);
// Unit vector of an axis; `axis` is neither kOfFormat nor kKeep.
std::array<double, 3> DirectionOf(UpAxis axis);

// Keeps the Gaussians whose centre is in the box, which does not count from the origin.
void Crop(const Box& box, ViewerScene* scene);

// Keeps the `count` Gaussians that contribute most to pictures from the scene's views, in their
// order; the contribution is alpha T summed over all pixels. `threads` <= 0: all cores. CANCELLED
// soon after the token is raised.
absl::Status KeepHeaviest(int64_t count, int threads, const CancelToken& cancel,
                          ViewerScene* scene);

}  // namespace litags

#endif  // LITAGS_ENGINE_EXPORT_VIEWER_SCENE_H_
