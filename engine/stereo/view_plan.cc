#include "engine/stereo/view_plan.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace litags {
namespace {

using Vec3 = std::array<double, 3>;

// Choices.
constexpr double kBestAngle = 7;   // degrees, between two views of a point
constexpr int kMaxSources = 6;     // photos compared with each
constexpr int kMinShared = 5;      // points that make a pair of views worth matching
constexpr int kMinAnchors = 8;     // below this the depth range is a guess
constexpr double kTail = 0.02;     // share of points at each end that may be wrong
constexpr double kNearerBy = 0.6;  // what is nearer or farther than the points
constexpr double kFartherBy = 2.0;

Vec3 DirectionTo(const Vec3& from, const Vec3& to) {
  Vec3 d = {to[0] - from[0], to[1] - from[1], to[2] - from[2]};
  const double n = std::max(1e-12, std::hypot(d[0], d[1], d[2]));
  for (double& x : d) x /= n;
  return d;
}

double AngleDeg(const Vec3& a, const Vec3& b) {
  const double dot = a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
  return std::acos(std::clamp(dot, -1.0, 1.0)) * 180 / std::numbers::pi;
}

// Choice: falls slower above the best angle than below it, as in MVSNet's view selection.
double AngleWeight(double angle_deg) {
  const double sigma = angle_deg < kBestAngle ? kBestAngle / 3 : kBestAngle;
  const double d = (angle_deg - kBestAngle) / sigma;
  return std::exp(-d * d / 2);
}

void SetRange(ViewPlan* plan) {
  std::vector<double> depths;
  for (const Anchor& a : plan->anchors) depths.push_back(a.depth);
  std::sort(depths.begin(), depths.end());
  const size_t tail = static_cast<size_t>(kTail * depths.size());
  plan->near_depth = kNearerBy * depths[tail];
  plan->far_depth = kFartherBy * depths[depths.size() - 1 - tail];
}

}  // namespace

std::vector<ViewPlan> PlanViews(absl::Span<const Camera> cameras,
                                absl::Span<const SparsePoint> points) {
  const size_t n = cameras.size();
  std::vector<ViewPlan> plans(n);
  std::vector<double> weight(n * n, 0.0);
  std::vector<int> shared(n * n, 0);
  std::vector<Vec3> centers;
  for (const Camera& camera : cameras) centers.push_back(camera.Center());
  for (const SparsePoint& point : points) {
    for (const TrackElement& a : point.track) {
      const Camera& camera = cameras[a.view];
      const Vec3 p = camera.CamFromWorld(point.xyz);
      if (!(p[2] > 0)) continue;
      const auto [x, y] = camera.Project(p);
      plans[a.view].anchors.push_back({x, y, p[2]});
      const Vec3 to_a = DirectionTo(centers[a.view], point.xyz);
      for (const TrackElement& b : point.track) {
        if (b.view == a.view) continue;
        const double angle = AngleDeg(to_a, DirectionTo(centers[b.view], point.xyz));
        weight[a.view * n + b.view] += AngleWeight(angle);
        ++shared[a.view * n + b.view];
      }
    }
  }
  for (size_t i = 0; i < n; ++i) {
    ViewPlan& plan = plans[i];
    if (plan.anchors.size() < kMinAnchors) continue;
    SetRange(&plan);
    for (size_t j = 0; j < n; ++j) {
      if (shared[i * n + j] >= kMinShared) plan.sources.push_back(static_cast<int>(j));
    }
    std::stable_sort(plan.sources.begin(), plan.sources.end(),
                     [&](int a, int b) { return weight[i * n + a] > weight[i * n + b]; });
    if (plan.sources.size() > kMaxSources) plan.sources.resize(kMaxSources);
  }
  return plans;
}

}  // namespace litags
