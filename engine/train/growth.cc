#include "engine/train/growth.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace litags {
namespace {

Eigen::Matrix3d Rotation(const Splats& s, size_t i) {
  double q[4], norm = 0;
  for (int k = 0; k < 4; ++k) {
    q[k] = s.at(i, kRawQuat + k);
    norm += q[k] * q[k];
  }
  norm = std::sqrt(std::max(norm, 1e-24));
  return Eigen::Quaterniond(q[0] / norm, q[1] / norm, q[2] / norm, q[3] / norm).toRotationMatrix();
}

}  // namespace

void MoveAlongAxes(const std::array<double, 3>& offset, const Splats& parent, size_t p, size_t i,
                   Splats* out) {
  const Eigen::Matrix3d rot = Rotation(parent, p);
  double local[3];
  for (int k = 0; k < 3; ++k) local[k] = std::exp(parent.at(p, kLogScale + k)) * offset[k];
  for (int k = 0; k < 3; ++k) {
    const double moved = rot(k, 0) * local[0] + rot(k, 1) * local[1] + rot(k, 2) * local[2];
    out->at(i, kMean + k) += static_cast<float>(moved);
  }
}

std::unique_ptr<GrowthStrategy> MakeGrowth(const Recipe& recipe, double extent) {
  switch (recipe.growth) {
    case Growth::kLongAxis:
      break;
    case Growth::kCloneSplit:
      return MakeCloneSplit(recipe.densify_percent * extent);
  }
  return MakeLongAxis();
}

}  // namespace litags
