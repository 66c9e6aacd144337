#include "engine/core/camera.h"

#include <algorithm>
#include <cmath>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "engine/core/shrunk_size.h"

namespace litags {
namespace {

using Vec3 = std::array<double, 3>;

Vec3 Sub(const Vec3& a, const Vec3& b) { return {a[0] - b[0], a[1] - b[1], a[2] - b[2]}; }
Vec3 Cross(const Vec3& a, const Vec3& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
double Dot(const Vec3& a, const Vec3& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

// Scales to unit length; false if the length is not a usable number.
bool Normalize(Vec3* v) {
  const double n = std::sqrt(Dot(*v, *v));
  if (!(n > 1e-12) || !std::isfinite(n)) return false;
  for (double& x : *v) x /= n;
  return true;
}

}  // namespace

std::array<double, 3> Camera::Center() const {
  return {-(R[0] * t[0] + R[3] * t[1] + R[6] * t[2]), -(R[1] * t[0] + R[4] * t[1] + R[7] * t[2]),
          -(R[2] * t[0] + R[5] * t[1] + R[8] * t[2])};
}

std::array<double, 3> Camera::CamFromWorld(const std::array<double, 3>& p) const {
  return {R[0] * p[0] + R[1] * p[1] + R[2] * p[2] + t[0],
          R[3] * p[0] + R[4] * p[1] + R[5] * p[2] + t[1],
          R[6] * p[0] + R[7] * p[1] + R[8] * p[2] + t[2]};
}

std::array<double, 3> Camera::WorldFromCam(const std::array<double, 3>& p) const {
  const double q[3] = {p[0] - t[0], p[1] - t[1], p[2] - t[2]};
  return {R[0] * q[0] + R[3] * q[1] + R[6] * q[2], R[1] * q[0] + R[4] * q[1] + R[7] * q[2],
          R[2] * q[0] + R[5] * q[1] + R[8] * q[2]};
}

Camera Camera::Moved(const std::array<double, 3>& offset) const {
  Camera out = *this;
  out.t = CamFromWorld({-offset[0], -offset[1], -offset[2]});
  return out;
}

Camera Camera::Scaled(int new_width, int new_height) const {
  Camera out = *this;
  const double sx = double(new_width) / width, sy = double(new_height) / height;
  out.width = new_width;
  out.height = new_height;
  out.fx *= sx;
  out.cx *= sx;
  out.fy *= sy;
  out.cy *= sy;
  return out;
}

Camera Camera::ShrunkTo(int max_side) const {
  const PictureSize size = ShrunkSize(width, height, max_side);
  return Scaled(size.width, size.height);
}

absl::Status Camera::Validate(std::string_view field, int64_t max_pixels) const {
  const std::string name(field);
  if (width <= 0 || height <= 0) {
    return InvalidInput(
        "BAD_CAMERA_SIZE", field,
        absl::StrCat(name, ": image size is ", width, "x", height, "; both must be positive"));
  }
  if (std::max(width, height) > kMaxImageSide) {
    return InvalidInput("IMAGE_TOO_LARGE", field,
                        absl::StrCat(name, ": ", width, "x", height, " is more than ",
                                     kMaxImageSide, " px on a side; ask for a smaller image"));
  }
  if (int64_t{width} * height > max_pixels) {
    return InvalidInput("IMAGE_TOO_LARGE", field,
                        absl::StrCat(name, ": ", width, "x", height, " exceeds ", max_pixels,
                                     " pixels; ask for a smaller image"));
  }
  for (double v : {fx, fy, cx, cy}) {
    if (!std::isfinite(v)) {
      return InvalidInput(
          "NOT_FINITE", field,
          absl::StrCat(name, ": an intrinsic is NaN or infinite; send finite fx, fy, cx, cy"));
    }
  }
  if (!(fx > 0) || !(fy > 0)) {
    return InvalidInput(
        "BAD_FOCAL_LENGTH", field,
        absl::StrCat(name, ": focal length ", fx, ", ", fy, " px must be positive"));
  }
  for (double v : R) {
    if (!std::isfinite(v)) {
      return InvalidInput(
          "NOT_FINITE", field,
          absl::StrCat(name, ": the pose holds NaN or infinity; send a finite 4x4 matrix"));
    }
  }
  for (double v : t) {
    if (!std::isfinite(v)) {
      return InvalidInput(
          "NOT_FINITE", field,
          absl::StrCat(name, ": the pose holds NaN or infinity; send a finite 4x4 matrix"));
    }
  }
  const Vec3 r0 = {R[0], R[1], R[2]}, r1 = {R[3], R[4], R[5]}, r2 = {R[6], R[7], R[8]};
  constexpr double kTolerance = 1e-3;
  const bool orthonormal =
      std::abs(Dot(r0, r0) - 1) < kTolerance && std::abs(Dot(r1, r1) - 1) < kTolerance &&
      std::abs(Dot(r2, r2) - 1) < kTolerance && std::abs(Dot(r0, r1)) < kTolerance &&
      std::abs(Dot(r0, r2)) < kTolerance && std::abs(Dot(r1, r2)) < kTolerance;
  if (!orthonormal || Dot(Cross(r0, r1), r2) < 0) {
    return InvalidInput(
        "NOT_A_ROTATION", field,
        absl::StrCat(name,
                     ": the upper-left 3x3 of the pose is not a rotation; rows must "
                     "be orthonormal and right-handed"));
  }
  return absl::OkStatus();
}

std::array<double, 16> Camera::Viewmat() const {
  return {R[0], R[1], R[2], t[0], R[3], R[4], R[5], t[1], R[6], R[7], R[8], t[2], 0, 0, 0, 1};
}

void Camera::SetViewmat(const std::array<double, 16>& m) {
  R = {m[0], m[1], m[2], m[4], m[5], m[6], m[8], m[9], m[10]};
  t = {m[3], m[7], m[11]};
}

absl::Status Camera::LookAt(const Vec3& eye, const Vec3& target, const Vec3& up) {
  Vec3 forward = Sub(target, eye);
  if (!Normalize(&forward)) {
    return InvalidInput("LOOK_AT_DEGENERATE", "look_at.target",
                        "look_at.target: equals the eye or is not finite; give a point to look at");
  }
  Vec3 right = Cross(forward, up);
  if (!Normalize(&right)) {
    return InvalidInput(
        "LOOK_AT_DEGENERATE", "look_at.up",
        "look_at.up: zero, not finite, or along the viewing direction; give another up");
  }
  const Vec3 down = Cross(forward, right);
  R = {right[0], right[1], right[2], down[0], down[1], down[2], forward[0], forward[1], forward[2]};
  t = {-Dot(right, eye), -Dot(down, eye), -Dot(forward, eye)};
  return absl::OkStatus();
}

}  // namespace litags
