#include "engine/sfm/turning.h"

#include <Eigen/Geometry>
#include <Eigen/SVD>
#include <algorithm>

#include "engine/core/check.h"
#include "engine/core/error.h"
#include "engine/core/quantile.h"

namespace litags {
namespace {

// The rotation that carries rays onto others with the least sum of squared differences (Kabsch).
Eigen::Matrix3d BestRotation(const Eigen::Matrix3Xd& from, const Eigen::Matrix3Xd& to) {
  const Eigen::Matrix3d sum = to * from.transpose();
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(sum, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Eigen::Vector3d sign(1, 1, (svd.matrixU() * svd.matrixV().transpose()).determinant());
  return svd.matrixU() * sign.asDiagonal() * svd.matrixV().transpose();
}

Eigen::Matrix3Xd Rays(const std::vector<Eigen::Vector2d>& points, double focal) {
  Eigen::Matrix3Xd rays(3, points.size());
  for (size_t i = 0; i < points.size(); ++i) {
    rays.col(static_cast<Eigen::Index>(i)) = points[i].homogeneous();
  }
  rays.bottomRows(1) *= focal;
  return rays.colwise().normalized();
}

// Median distance, px, of what a rotation makes of the first photo's points from the second's.
double Residual(const SeenTwice& pair, double focal) {
  const Eigen::Matrix3Xd from = Rays(pair.first, focal), to = Rays(pair.second, focal);
  const Eigen::Matrix3Xd turned = BestRotation(from, to) * from;
  std::vector<double> distances;
  for (Eigen::Index i = 0; i < turned.cols(); ++i) {
    distances.push_back((turned.col(i).hnormalized() - to.col(i).hnormalized()).norm() * focal);
  }
  return Median(std::move(distances));
}

}  // namespace

absl::StatusOr<bool> TurnedInPlace(const std::vector<SeenTwice>& pairs, double longer_side,
                                   const CancelToken& cancel) {
  // Focal lengths of lenses, in longer sides: a fisheye's middle to a telephoto's 150 mm of 36 mm.
  constexpr double kShortest = 0.3, kLongest = 4, kStep = 1.05;
  constexpr double kMostResidual = 2;  // px: half of what COLMAP's verification allows
  if (pairs.empty()) return false;
  double least = 0, best = 0;
  for (double focal = kShortest; focal < kLongest * kStep; focal *= kStep) {
    LITAGS_RETURN_IF_ERROR(cancel.Check());
    std::vector<double> residuals;
    for (const SeenTwice& pair : pairs) {
      LITAGS_CHECK(!pair.first.empty() && pair.first.size() == pair.second.size());
      residuals.push_back(Residual(pair, focal * longer_side));
    }
    const double residual = Median(std::move(residuals));
    if (best > 0 && residual >= least) continue;
    least = residual;
    best = focal;
  }
  return least <= kMostResidual && best < kLongest / kStep;
}

}  // namespace litags
