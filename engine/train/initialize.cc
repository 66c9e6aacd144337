#include "engine/train/initialize.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/core.hpp>
#include <opencv2/flann.hpp>
#include <optional>

#include "absl/strings/str_cat.h"
#include "engine/core/camera_spread.h"
#include "engine/core/error.h"
#include "engine/core/mask.h"
#include "engine/core/pixel_at.h"
#include "engine/core/splats.h"

namespace litags {
namespace {

constexpr double kInitialOpacity = 0.1;
constexpr int kNeighbours = 3;        // that make the scale
constexpr int kPlaneNeighbours = 12;  // that make the plane. Choice
// Variance across the plane over the smaller one in it, at most: more is no surface. Choice
constexpr double kPlaneThickness = 0.3;
constexpr double kDiskThickness = 0.1;  // of a disk's other scales. Choice

// A point among its nearest neighbours.
struct Neighbourhood {
  float distance;                   // root mean squared, to the nearest three; at least 1e-7
  std::optional<cv::Vec3d> normal;  // of the plane that the nearest twelve are close to, if any
};

// Normal of the plane that these rows of `data` are close to.
std::optional<cv::Vec3d> NormalOf(const cv::Mat_<float>& data, const cv::Mat_<int>& rows) {
  const auto point = [&](int row) { return cv::Vec3d(data(row, 0), data(row, 1), data(row, 2)); };
  cv::Vec3d mean;
  for (const int row : rows) mean += point(row) / static_cast<double>(rows.total());
  cv::Matx33d products = cv::Matx33d::zeros();
  for (const int row : rows) products += (point(row) - mean) * (point(row) - mean).t();
  cv::Vec3d variances;  // the largest first
  cv::Matx33d axes;     // a row each
  cv::eigen(products, variances, axes);
  if (!(variances[2] < kPlaneThickness * variances[1])) return std::nullopt;
  return cv::Vec3d(axes(2, 0), axes(2, 1), axes(2, 2));
}

std::vector<Neighbourhood> Neighbourhoods(absl::Span<const SparsePoint> points, StartShape shape) {
  const int n = static_cast<int>(points.size());
  const int nearest =
      std::min(n, 1 + (shape == StartShape::kDisk ? kPlaneNeighbours : kNeighbours));
  cv::Mat_<float> data(n, 3);
  for (int i = 0; i < n; ++i) {
    for (int k = 0; k < 3; ++k) data(i, k) = static_cast<float>(points[i].xyz[k]);
  }
  cv::flann::GenericIndex<cvflann::L2_Simple<float>> index(data,
                                                           cvflann::KDTreeSingleIndexParams());
  cv::Mat_<int> indices(n, nearest);
  cv::Mat_<float> squared(n, nearest);
  index.knnSearch(data, indices, squared, nearest, cvflann::SearchParams(-1));
  std::vector<Neighbourhood> out(n);
  for (int i = 0; i < n; ++i) {
    double sum = 0;  // the nearest is the point itself
    for (int k = 1; k <= kNeighbours; ++k) sum += squared(i, k);
    out[i].distance = static_cast<float>(std::sqrt(std::max(sum / kNeighbours, 1e-14)));
    if (shape == StartShape::kDisk) out[i].normal = NormalOf(data, indices.row(i));
  }
  return out;
}

// Makes the ball of index i a disk across `normal`, of length 1: its third axis is turned there.
void Flatten(cv::Vec3d normal, size_t i, Splats* splats) {
  if (normal[2] < 0) normal = -normal;  // either way is the same disk; the shorter turn
  const double quat[4] = {1 + normal[2], -normal[1], normal[0], 0};
  const double norm = std::sqrt(2 * (1 + normal[2]));
  for (int k = 0; k < 4; ++k) splats->at(i, kRawQuat + k) = static_cast<float>(quat[k] / norm);
  splats->at(i, kLogScale + 2) += static_cast<float>(std::log(kDiskThickness));
}

// Mean pseudo-target colour where the photos saw the point, unmasked; the point's own colour if
// none did.
std::array<double, 3> PointColor(const SparsePoint& point, absl::Span<const int> point_views,
                                 absl::Span<const TrainView> views) {
  std::array<double, 3> sum = {0, 0, 0};
  int seen = 0;
  for (const TrackElement& element : point.track) {
    const int v =
        element.view < static_cast<int>(point_views.size()) ? point_views[element.view] : -1;
    if (v < 0) continue;
    const auto p = views[v].view.camera.CamFromWorld(point.xyz);
    const Camera& camera = views[v].view.camera;
    if (p[2] <= 0) continue;
    const auto [px, py] = camera.Project(p);
    const std::optional<PixelIndex> at = PixelAt(px, py, camera.width, camera.height);
    if (!at.has_value() || !Counts(views[v].mask, at->x, at->y)) continue;
    const int16_t* pixel = views[v].target.pixel(at->x, at->y);
    for (int c = 0; c < 3; ++c) sum[c] += EncodedOf(pixel[c]);
    ++seen;
  }
  for (int c = 0; c < 3; ++c) sum[c] = seen > 0 ? sum[c] / seen : point.rgb[c] / 255.0;
  return sum;
}

// mean(photo) / mean(target) over what counts of all views: what L must be for R L to look like the
// photos.
double IlluminationLevel(absl::Span<const TrainView> views) {
  double photo = 0, target = 0;
  for (const TrainView& view : views) {
    ForCounted(view.mask, view.photo.data.size() / 3, [&](size_t i) {
      for (int c = 0; c < 3; ++c) photo += view.photo.data[3 * i + c];
      for (int c = 0; c < 3; ++c) target += view.target.data[3 * i + c];
    });
  }
  return target > 0 && photo > 0 ? photo / target : 1;  // sums of noise around black may be below
}

}  // namespace

double SceneExtent(absl::Span<const TrainView> views) {
  std::vector<View> all;
  for (const TrainView& v : views) all.push_back(v.view);
  const std::vector<View> near = NearViews(all);
  std::array<double, 3> mean = {0, 0, 0};
  for (const View& v : near) {
    for (int k = 0; k < 3; ++k) mean[k] += v.camera.Center()[k] / near.size();
  }
  double radius = 0;
  for (const View& v : near) {
    const auto c = v.camera.Center();
    radius = std::max(radius, std::hypot(c[0] - mean[0], c[1] - mean[1], c[2] - mean[2]));
  }
  return std::max(1.1 * radius, 1e-6);
}

absl::StatusOr<Splats> InitializeFromPoints(absl::Span<const SparsePoint> points,
                                            absl::Span<const int> point_views,
                                            absl::Span<const TrainView> views, StartShape shape) {
  if (points.size() <= kNeighbours) {
    return MakeError(
        absl::StatusCode::kFailedPrecondition, "TOO_FEW_POINTS", "images",
        absl::StrCat("only ", points.size(),
                     " 3D points were found; take photos with more overlap or texture"));
  }
  const std::vector<Neighbourhood> near = Neighbourhoods(points, shape);
  const float illumination = static_cast<float>(IlluminationLevel(views));
  const float logit = LogitOf(kInitialOpacity);
  Splats splats(points.size());
  for (size_t i = 0; i < points.size(); ++i) {
    const std::array<double, 3> color = PointColor(points[i], point_views, views);
    double depth = 0;
    for (const TrainView& v : views)
      depth += v.view.camera.CamFromWorld(points[i].xyz)[2] / views.size();
    for (int k = 0; k < 3; ++k) {
      splats.at(i, kMean + k) = static_cast<float>(points[i].xyz[k]);
      splats.at(i, kLogScale + k) = std::log(near[i].distance);
      splats.at(i, kShDc + k) = static_cast<float>((color[k] - 0.5) / kSh0);
      splats.at(i, kIllumination + k) = illumination;
    }
    splats.at(i, kRawQuat) = 1;
    if (near[i].normal.has_value()) Flatten(*near[i].normal, i, &splats);
    splats.at(i, kLogitOpacity) = logit;
    splats.at(i, kDepth) = static_cast<float>(depth);
  }
  return splats;
}

}  // namespace litags
