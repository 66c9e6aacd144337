// Three doubles, for points, directions and linear-light colours of the sample tracer.
#ifndef LITAGS_ENGINE_SAMPLE_VEC_H_
#define LITAGS_ENGINE_SAMPLE_VEC_H_

#include <algorithm>
#include <array>
#include <cmath>

namespace litags::sample {

struct Vec3 {
  double x = 0, y = 0, z = 0;

  double operator[](int i) const { return i == 0 ? x : i == 1 ? y : z; }
};

inline Vec3 operator+(const Vec3& a, const Vec3& b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
inline Vec3 operator-(const Vec3& a, const Vec3& b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
inline Vec3 operator-(const Vec3& a) { return {-a.x, -a.y, -a.z}; }
inline Vec3 operator*(const Vec3& a, const Vec3& b) { return {a.x * b.x, a.y * b.y, a.z * b.z}; }
inline Vec3 operator*(const Vec3& a, double s) { return {a.x * s, a.y * s, a.z * s}; }
inline Vec3 operator*(double s, const Vec3& a) { return a * s; }
inline Vec3& operator+=(Vec3& a, const Vec3& b) { return a = a + b; }

inline double Dot(const Vec3& a, const Vec3& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline Vec3 Cross(const Vec3& a, const Vec3& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
inline double Length(const Vec3& a) { return std::sqrt(Dot(a, a)); }
inline Vec3 Normalized(const Vec3& a) { return a * (1 / Length(a)); }
inline Vec3 Lerp(const Vec3& a, const Vec3& b, double t) { return a + (b - a) * t; }
inline Vec3 Min(const Vec3& a, const Vec3& b) {
  return {std::min(a.x, b.x), std::min(a.y, b.y), std::min(a.z, b.z)};
}
inline Vec3 Max(const Vec3& a, const Vec3& b) {
  return {std::max(a.x, b.x), std::max(a.y, b.y), std::max(a.z, b.z)};
}
inline Vec3 ToVec3(const std::array<double, 3>& a) { return {a[0], a[1], a[2]}; }
inline std::array<double, 3> ToArray(const Vec3& a) { return {a.x, a.y, a.z}; }

// An orthonormal frame: rows are the frame's axes in world coordinates.
struct Frame {
  Vec3 ex{1, 0, 0}, ey{0, 1, 0}, ez{0, 0, 1};

  Vec3 FromWorld(const Vec3& v) const { return {Dot(ex, v), Dot(ey, v), Dot(ez, v)}; }
  Vec3 ToWorld(const Vec3& v) const { return ex * v.x + ey * v.y + ez * v.z; }
};

// Turned by `yaw` about the world's z axis, then leaned back by `tilt` about the frame's x axis
// (radians).
inline Frame YawTilt(double yaw, double tilt = 0) {
  const double c = std::cos(yaw), s = std::sin(yaw), ct = std::cos(tilt), st = std::sin(tilt);
  const Vec3 side{c, s, 0}, back{-s, c, 0}, up{0, 0, 1};
  return {side, back * ct - up * st, back * st + up * ct};
}

}  // namespace litags::sample

#endif  // LITAGS_ENGINE_SAMPLE_VEC_H_
