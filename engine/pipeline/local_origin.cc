#include "engine/pipeline/local_origin.h"

#include <algorithm>
#include <cmath>

#include "absl/strings/str_format.h"
#include "engine/core/camera_spread.h"

namespace litags {
namespace {

// Of the origin's distance, in distances between the cameras. Floats have steps of 1e-7 of it, and
// what is seen may be much nearer than the cameras are far apart.
constexpr double kMaxOffset = 100;

}  // namespace

std::array<double, 3> LocalOrigin(const std::vector<View>& all) {
  const std::vector<View> views = NearViews(all);
  std::array<double, 3> mean = {};
  for (const View& v : views) {
    const std::array<double, 3> center = v.camera.Center();
    for (int k = 0; k < 3; ++k) mean[k] += center[k] / views.size();
  }
  double spread = 0;
  for (const View& v : views) {
    const std::array<double, 3> c = v.camera.Center();
    spread = std::max(spread, std::hypot(c[0] - mean[0], c[1] - mean[1], c[2] - mean[2]));
  }
  if (!(std::hypot(mean[0], mean[1], mean[2]) > kMaxOffset * spread)) return {};
  if (spread > 1) {
    for (double& x : mean) x = std::round(x);
  }
  return mean;
}

void TakeAsOrigin(const std::array<double, 3>& origin, SparseModel* model) {
  for (View& v : model->views) v.camera = v.camera.Moved({-origin[0], -origin[1], -origin[2]});
  for (SparsePoint& p : model->points) {
    for (int k = 0; k < 3; ++k) p.xyz[k] -= origin[k];
  }
}

std::string DescribeOrigin(const std::array<double, 3>& origin) {
  return absl::StrFormat(
      "the cameras stand far from the origin: the scene's Gaussians are kept relative to (%.12g, "
      "%.12g, %.12g). Views are rendered in your coordinates; an exported .ply of Gaussians "
      "names what to add to its positions in its comment 'origin'. .glb and .usda name it as a "
      "translation, which turns with the scene where they turn it up: --up keep leaves it in your "
      "axes",
      origin[0], origin[1], origin[2]);
}

}  // namespace litags
