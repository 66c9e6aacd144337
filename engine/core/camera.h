#ifndef LITAGS_ENGINE_CORE_CAMERA_H_
#define LITAGS_ENGINE_CORE_CAMERA_H_

#include <array>
#include <cstdint>
#include <string>
#include <string_view>

#include "absl/status/status.h"

namespace litags {

// Longest side of a picture, px: boxes of Gaussians are kept in 16 bits.
inline constexpr int kMaxImageSide = 32766;
inline constexpr int64_t kMaxImagePixels = int64_t{64} << 20;

// A pinhole camera. OpenCV axes (x right, y down, z forward); x_cam = R x_world + t; the centre
// of the top-left pixel is at (0.5, 0.5). Photos with lens distortion are undistorted on load.
struct Camera {
  int width = 0;                          // px
  int height = 0;                         // px
  double fx = 0, fy = 0, cx = 0, cy = 0;  // px

  std::array<double, 9> R = {1, 0, 0, 0, 1, 0, 0, 0, 1};  // cam_from_world, row-major
  std::array<double, 3> t = {0, 0, 0};                    // cam_from_world

  // Camera centre in world coordinates: -R^T t.
  std::array<double, 3> Center() const;

  // World point to camera frame, and back.
  std::array<double, 3> CamFromWorld(const std::array<double, 3>& point) const;
  std::array<double, 3> WorldFromCam(const std::array<double, 3>& point) const;

  // A point of the camera frame, z > 0, to its place in the picture, px; and the point of the
  // camera frame at depth z behind the place (x, y), px.
  std::array<double, 2> Project(const std::array<double, 3>& p) const {
    return {fx * p[0] / p[2] + cx, fy * p[1] / p[2] + cy};
  }
  std::array<double, 3> Unproject(double x, double y, double z) const {
    return {(x - cx) / fx * z, (y - cy) / fy * z, z};
  }

  // The camera carried by `offset`, looking the same way: it sees of a world carried with it what
  // this one sees.
  Camera Moved(const std::array<double, 3>& offset) const;

  // Same view at another image size: intrinsics scaled, pose kept.
  Camera Scaled(int new_width, int new_height) const;
  // With the longer side `max_side` px, unless it is shorter.
  Camera ShrunkTo(int max_side) const;

  // INVALID_ARGUMENT naming `field` if a number is not finite, the size or a focal length is not
  // positive, the size exceeds `max_pixels` or kMaxImageSide, or R is not a rotation (to 1e-3).
  absl::Status Validate(std::string_view field, int64_t max_pixels = kMaxImagePixels) const;

  // Row-major 4x4 cam_from_world, to and from.
  std::array<double, 16> Viewmat() const;
  void SetViewmat(const std::array<double, 16>& viewmat);

  // Camera at `eye` looking at `target`; `up` is the world direction that appears upwards.
  // INVALID_ARGUMENT if the directions are degenerate. Intrinsics are left alone.
  absl::Status LookAt(const std::array<double, 3>& eye, const std::array<double, 3>& target,
                      const std::array<double, 3>& up);
};

// A named camera: the photo's file name and where it was taken from.
struct View {
  std::string name;
  Camera camera;
};

}  // namespace litags

#endif  // LITAGS_ENGINE_CORE_CAMERA_H_
