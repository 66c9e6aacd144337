#include "engine/train/growth.h"

#include <algorithm>
#include <cmath>

namespace litags {
namespace {

// Rotation matrix of the stored quaternion, row-major.
std::array<double, 9> Rotation(const Splats& s, size_t i) {
  double q[4], norm = 0;
  for (int k = 0; k < 4; ++k) {
    q[k] = s.at(i, kRawQuat + k);
    norm += q[k] * q[k];
  }
  norm = std::sqrt(std::max(norm, 1e-24));
  const double w = q[0] / norm, x = q[1] / norm, y = q[2] / norm, z = q[3] / norm;
  return {1 - 2 * (y * y + z * z), 2 * (x * y - w * z),     2 * (x * z + w * y),
          2 * (x * y + w * z),     1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
          2 * (x * z - w * y),     2 * (y * z + w * x),     1 - 2 * (x * x + y * y)};
}

}  // namespace

void MoveAlongAxes(const std::array<double, 3>& offset, const Splats& parent, size_t p, size_t i,
                   Splats* out) {
  const std::array<double, 9> rot = Rotation(parent, p);
  double local[3];
  for (int k = 0; k < 3; ++k) local[k] = std::exp(parent.at(p, kLogScale + k)) * offset[k];
  for (int k = 0; k < 3; ++k) {
    const double moved =
        rot[3 * k] * local[0] + rot[3 * k + 1] * local[1] + rot[3 * k + 2] * local[2];
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
