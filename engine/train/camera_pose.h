// Poses of cameras that training refines.
#ifndef LITAGS_ENGINE_TRAIN_CAMERA_POSE_H_
#define LITAGS_ENGINE_TRAIN_CAMERA_POSE_H_

#include <array>
#include <type_traits>

#include "absl/types/span.h"
#include "engine/core/camera.h"
#include "engine/core/splats.h"
#include "engine/render/renderer.h"
#include "engine/train/adam.h"

namespace litags {

// A camera's pose, cam_from_world as in Camera, with its moments of Adam. Nothing but doubles:
// checkpoints hold it as it lies in memory.
struct CameraPose {
  CameraPose() = default;
  explicit CameraPose(const Camera& camera) : R(camera.R), t(camera.t) {}

  // `camera` from here.
  Camera Apply(Camera camera) const {
    camera.R = R;
    camera.t = t;
    return camera;
  }

  std::array<double, 9> R = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  std::array<double, 3> t = {0, 0, 0};
  PoseVector moment1 = {}, moment2 = {};
};
static_assert(sizeof(CameraPose) == 24 * sizeof(double) &&
              std::is_trivially_copyable_v<CameraPose>);

// Step `step` (from 1) of Adam along `grad`, in the camera's own axes. `lr`: radians; of shifts it
// is times `extent`, scene units. False if a number is no longer finite, and then nothing changed.
bool StepPose(const PoseVector& grad, int step, double lr, double extent,
              const AdamConstants& constants, CameraPose* pose);

// x' = scale R x + t.
struct Similarity {
  double scale = 1;
  std::array<double, 9> R = {1, 0, 0, 0, 1, 0, 0, 0, 1};  // row-major
  std::array<double, 3> t = {0, 0, 0};
};

// The move of the world that takes cameras `from` to cameras `to`, one by one, as nearly as it can:
// least squares of directions and of places over `extent`, scene units. Cameras `to` at one place
// tell no scale: 1.
Similarity AlignPoses(absl::Span<const CameraPose> from, absl::Span<const CameraPose> to,
                      double extent);

// Moves world and cameras alike, so that pictures stay. Colours keep the directions of view that
// they had, so that `move` must turn little.
void MoveWorld(const Similarity& move, Splats* splats, absl::Span<CameraPose> poses);

// How far apart two poses are.
struct PoseDifference {
  double degrees = 0;   // of the turn between them
  double distance = 0;  // of the centres, scene units
};
PoseDifference DifferenceOf(const Camera& a, const Camera& b);

}  // namespace litags

#endif  // LITAGS_ENGINE_TRAIN_CAMERA_POSE_H_
