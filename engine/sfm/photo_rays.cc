#include "engine/sfm/photo_rays.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <numbers>
#include <utility>

namespace litags {
namespace {

// Rays this near to parallel meet nowhere in particular: which side of the cameras says nothing.
const double kParallel = std::cos(0.25 * std::numbers::pi / 180);

constexpr double kNowhere = std::numeric_limits<double>::quiet_NaN();

// Whether the rays come nearest to each other in front of both cameras.
bool MeetInFront(const PhotoRays& first, const PhotoRays& second, const Eigen::Vector3d& ray1,
                 const Eigen::Vector3d& ray2) {
  const double c = ray1.dot(ray2);
  if (c > kParallel) return true;
  const Eigen::Vector3d base = second.center - first.center;
  const double b1 = base.dot(ray1), b2 = base.dot(ray2);
  // Distances along the rays, times 1 - c^2 > 0.
  return b1 - c * b2 > 0 && c * b1 - b2 > 0;
}

}  // namespace

std::optional<Eigen::Vector2d> UndistortPoint(const Camera& camera, const Distortion& distortion,
                                              const Eigen::Vector2d& seen) {
  if (distortion.IsZero()) return seen;
  const auto point =
      Undistort(distortion, (seen.x() - camera.cx) / camera.fx, (seen.y() - camera.cy) / camera.fy);
  if (!point.has_value()) return std::nullopt;
  return Eigen::Vector2d(camera.fx * (*point)[0] + camera.cx, camera.fy * (*point)[1] + camera.cy);
}

PhotoRays::PhotoRays(const Camera& camera, const Distortion& distortion,
                     const std::vector<Eigen::Vector2d>& keypoints) {
  K << camera.fx, 0, camera.cx, 0, camera.fy, camera.cy, 0, 0, 1;
  R = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(camera.R.data());
  t = Eigen::Map<const Eigen::Vector3d>(camera.t.data());
  center = -R.transpose() * t;
  std::map<std::pair<double, double>, int> first_at;
  for (const Eigen::Vector2d& seen : keypoints) {
    const Eigen::Vector2d point =
        UndistortPoint(camera, distortion, seen).value_or(Eigen::Vector2d::Constant(kNowhere));
    const Eigen::Vector3d in_camera((point.x() - camera.cx) / camera.fx,
                                    (point.y() - camera.cy) / camera.fy, 1);
    const int index = static_cast<int>(points.size());
    points.push_back(point);
    rays.push_back((R.transpose() * in_camera).normalized());
    twin_of.push_back(first_at.emplace(std::pair(seen.x(), seen.y()), index).first->second);
  }
}

Eigen::Matrix3d FundamentalMatrix(const PhotoRays& first, const PhotoRays& second) {
  const Eigen::Matrix3d R = second.R * first.R.transpose();  // second_from_first
  const Eigen::Vector3d t = second.t - R * first.t;
  Eigen::Matrix3d cross;
  cross << 0, -t.z(), t.y(), t.z(), 0, -t.x(), -t.y(), t.x(), 0;
  return second.K.inverse().transpose() * cross * R * first.K.inverse();
}

double SampsonError(const Eigen::Matrix3d& fundamental, const Eigen::Vector2d& first,
                    const Eigen::Vector2d& second) {
  const Eigen::Vector3d line2 = fundamental * first.homogeneous();
  const Eigen::Vector3d line1 = fundamental.transpose() * second.homogeneous();
  const double gradient = std::sqrt(line2.head<2>().squaredNorm() + line1.head<2>().squaredNorm());
  if (!(gradient > 0)) return std::numeric_limits<double>::infinity();
  return std::abs(second.homogeneous().dot(line2)) / gradient;
}

std::vector<VerifiedMatch> VerifyMatches(const PhotoRays& first, const PhotoRays& second,
                                         const std::vector<FeatureMatch>& matches,
                                         double max_error_px) {
  const Eigen::Matrix3d fundamental = FundamentalMatrix(first, second);
  std::vector<VerifiedMatch> verified;
  for (const FeatureMatch& match : matches) {
    const int f1 = first.twin_of[match.index1], f2 = second.twin_of[match.index2];
    const double error = SampsonError(fundamental, first.points[f1], second.points[f2]);
    if (!(error <= max_error_px)) continue;
    if (!MeetInFront(first, second, first.rays[f1], second.rays[f2])) continue;
    verified.push_back({f1, f2, error});
  }
  const auto key = [](const VerifiedMatch& m) { return std::pair(m.feature1, m.feature2); };
  std::sort(verified.begin(), verified.end(),
            [&](const auto& a, const auto& b) { return key(a) < key(b); });
  verified.erase(std::unique(verified.begin(), verified.end(),
                             [&](const auto& a, const auto& b) { return key(a) == key(b); }),
                 verified.end());
  return verified;
}

}  // namespace litags
