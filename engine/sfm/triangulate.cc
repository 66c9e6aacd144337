#include "engine/sfm/triangulate.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include "engine/core/error.h"
#include "engine/core/parallel.h"
#include "engine/sfm/descriptor_match.h"

namespace litags {
namespace {

// Pairs of rays that a track's point is tried from; of long tracks every so many.
constexpr int kMaxHypotheses = 300;
constexpr int kNewtonSteps = 10;
// Rounds of completing and joining: hardly a point changes after the second.
constexpr int kRounds = 3;

// Of a match from its epipolar geometry, of a point from its features. COLMAP's
// filter_max_reproj_error and RANSAC's max_error.
constexpr double kMaxErrorPx = 4;
constexpr double kSquaredLimit = kMaxErrorPx * kMaxErrorPx;
// Between some two rays of a point. COLMAP's filter_min_tri_angle.
constexpr double kMinAngleDeg = 1.5;
// Points of two photos only, for which just one epipolar line speaks. Choice: of those with a mean
// error of 0.5 to 1 px a fifth are wrong in castle's `low`, beyond 1 px most; below 4 degrees half
// of fox's are more than 2 % off in depth.
constexpr double kMaxPairErrorPx = 0.5;
constexpr double kMinPairAngleDeg = 4;

double CosOf(double degrees) { return std::cos(degrees * std::numbers::pi / 180); }

const Eigen::Vector3d& RayOf(const std::vector<PhotoRays>& photos, const Observation& o) {
  return photos[o.photo].rays[o.feature];
}

// Squared distance of the point's picture from the feature, px^2; infinite behind the camera.
double SquaredError(const std::vector<PhotoRays>& photos, const Observation& o,
                    const Eigen::Vector3d& xyz) {
  const PhotoRays& photo = photos[o.photo];
  const Eigen::Vector3d p = photo.CamFromWorld(xyz);
  if (!(p.z() > 0)) return std::numeric_limits<double>::infinity();
  return ((photo.K * p).hnormalized() - photo.points[o.feature]).squaredNorm();
}

// Middle of the shortest line between two rays.
Eigen::Vector3d MidPoint(const std::vector<PhotoRays>& photos, const Observation& a,
                         const Observation& b) {
  const Eigen::Vector3d &ca = photos[a.photo].center, &cb = photos[b.photo].center;
  const Eigen::Vector3d &ra = RayOf(photos, a), &rb = RayOf(photos, b);
  const Eigen::Vector3d base = cb - ca;
  const double c = ra.dot(rb), ba = base.dot(ra), bb = base.dot(rb), scale = 1 / (1 - c * c);
  return 0.5 * (ca + (ba - c * bb) * scale * ra + cb + (c * ba - bb) * scale * rb);
}

// Sum of squared errors, the one to beat by a step.
double Cost(const std::vector<PhotoRays>& photos, const std::vector<Observation>& track,
            const Eigen::Vector3d& xyz) {
  double cost = 0;
  for (const Observation& o : track) cost += SquaredError(photos, o, xyz);
  return cost;
}

// One Gauss-Newton step for the sum of squared errors.
Eigen::Vector3d NewtonStep(const std::vector<PhotoRays>& photos,
                           const std::vector<Observation>& track, const Eigen::Vector3d& xyz) {
  Eigen::Matrix3d H = Eigen::Matrix3d::Zero();
  Eigen::Vector3d g = Eigen::Vector3d::Zero();
  for (const Observation& o : track) {
    const PhotoRays& photo = photos[o.photo];
    const Eigen::Vector3d p = photo.CamFromWorld(xyz);
    const double fx = photo.K(0, 0), fy = photo.K(1, 1);
    Eigen::Matrix<double, 2, 3> by_camera;
    by_camera << fx / p.z(), 0, -fx * p.x() / (p.z() * p.z()),  //
        0, fy / p.z(), -fy * p.y() / (p.z() * p.z());
    const Eigen::Matrix<double, 2, 3> J = by_camera * photo.R;
    const Eigen::Vector2d r = (photo.K * p).hnormalized() - photo.points[o.feature];
    H += J.transpose() * J;
    g += J.transpose() * r;
  }
  return -H.ldlt().solve(g);
}

Eigen::Vector3d Refine(const std::vector<PhotoRays>& photos, const std::vector<Observation>& track,
                       Eigen::Vector3d xyz) {
  double cost = Cost(photos, track, xyz);
  for (int i = 0; i < kNewtonSteps && std::isfinite(cost); ++i) {
    const Eigen::Vector3d next = xyz + NewtonStep(photos, track, xyz);
    const double next_cost = Cost(photos, track, next);
    if (!(next_cost < cost)) break;
    const bool settled = next_cost > cost * (1 - 1e-9);
    xyz = next;
    cost = next_cost;
    if (settled) break;
  }
  return xyz;
}

std::vector<Observation> Agreeing(const std::vector<PhotoRays>& photos,
                                  const std::vector<Observation>& track,
                                  const Eigen::Vector3d& xyz) {
  std::vector<Observation> agreeing;
  for (const Observation& o : track) {
    if (SquaredError(photos, o, xyz) <= kSquaredLimit) agreeing.push_back(o);
  }
  return agreeing;
}

bool HasAngle(const std::vector<PhotoRays>& photos, const TriangulatedPoint& point,
              double min_angle_deg) {
  const double cos_of_min_angle = CosOf(min_angle_deg);
  std::vector<Eigen::Vector3d> rays;
  for (const Observation& o : point.track) {
    rays.push_back((point.xyz - photos[o.photo].center).normalized());
  }
  for (size_t i = 0; i < rays.size(); ++i) {
    for (size_t j = i + 1; j < rays.size(); ++j) {
      if (rays[i].dot(rays[j]) <= cos_of_min_angle) return true;
    }
  }
  return false;
}

// Refines a point on its track, drops what does not agree, and empties the track of a point that
// is none.
void Settle(const std::vector<PhotoRays>& photos, TriangulatedPoint& point) {
  for (size_t before = 0; before != point.track.size();) {
    before = point.track.size();
    point.xyz = Refine(photos, point.track, point.xyz);
    point.track = Agreeing(photos, point.track, point.xyz);
  }
  if (point.track.size() < 2 || !HasAngle(photos, point, kMinAngleDeg)) {
    point.track.clear();
    return;
  }
  point.error = 0;
  for (const Observation& o : point.track) {
    point.error += std::sqrt(SquaredError(photos, o, point.xyz)) / point.track.size();
  }
}

// The points that the features of one track are of: what does not agree with the first may agree
// with each other.
std::vector<TriangulatedPoint> PointsOfTrack(const std::vector<PhotoRays>& photos,
                                             std::vector<Observation> track) {
  std::vector<TriangulatedPoint> points;
  while (track.size() >= 2) {
    TriangulatedPoint point = TriangulateTrack(photos, track);
    if (point.track.empty()) break;
    std::erase_if(track, [&](const Observation& o) {
      return std::binary_search(point.track.begin(), point.track.end(), o);
    });
    points.push_back(std::move(point));
  }
  return points;
}

// Points, and which point each feature is of. Changes are made one after the other, in the order
// of the points, so that the result is one.
class PointSet {
 public:
  PointSet(const std::vector<PhotoRays>& photos, const MatchGraph& graph)
      : photos_(photos), graph_(graph), point_of_(graph.num_features(), -1) {}

  void Add(TriangulatedPoint point) {
    Mark(point, static_cast<int>(points_.size()));
    points_.push_back(std::move(point));
  }

  // One round over all points; false if nothing changed.
  bool CompleteAndJoin() {
    bool changed = false;
    for (size_t i = 0; i < points_.size(); ++i) {
      if (points_[i].track.empty()) continue;
      changed |= Complete(static_cast<int>(i));
      changed |= JoinOthers(static_cast<int>(i));
    }
    return changed;
  }

  std::vector<TriangulatedPoint> Take() {
    std::erase_if(points_, [&](const TriangulatedPoint& p) {
      return p.track.empty() || (p.track.size() == 2 && (p.error > kMaxPairErrorPx ||
                                                         !HasAngle(photos_, p, kMinPairAngleDeg)));
    });
    return std::move(points_);
  }

 private:
  void Mark(const TriangulatedPoint& point, int index) {
    for (const Observation& o : point.track) point_of_[graph_.Id(o)] = index;
  }

  static bool Sees(const TriangulatedPoint& point, int photo) {
    const auto at = std::lower_bound(point.track.begin(), point.track.end(), Observation{photo, 0});
    return at != point.track.end() && at->photo == photo;
  }

  // Takes `next` in the place of point `index`.
  void Replace(int index, TriangulatedPoint next) {
    Mark(points_[index], -1);
    points_[index] = std::move(next);
    Mark(points_[index], index);
  }

  // Adds free features that are matched with those of the point and agree with it.
  bool Complete(int index) {
    TriangulatedPoint next = points_[index];
    const std::vector<Observation> before = next.track;
    for (const Observation& o : before) {
      for (const int id : graph_.Neighbours(graph_.Id(o))) {
        const Observation other = graph_.Of(id);
        if (point_of_[id] >= 0 || Sees(next, other.photo)) continue;
        if (SquaredError(photos_, other, next.xyz) > kSquaredLimit) continue;
        next.track.insert(std::upper_bound(next.track.begin(), next.track.end(), other), other);
      }
    }
    if (next.track.size() == before.size()) return false;
    Settle(photos_, next);
    if (next.track.size() <= before.size()) return false;
    Replace(index, std::move(next));
    return true;
  }

  // Takes in points that features of this one are matched with, if one point explains both.
  bool JoinOthers(int index) {
    bool joined = false;
    for (bool again = true; again;) {
      again = false;
      const std::vector<Observation> track = points_[index].track;
      for (const Observation& o : track) {
        for (const int id : graph_.Neighbours(graph_.Id(o))) {
          const int other = point_of_[id];
          if (other < 0 || other == index || !Join(index, other)) continue;
          again = joined = true;
        }
      }
    }
    return joined;
  }

  bool Join(int index, int other) {
    const TriangulatedPoint &a = points_[index], &b = points_[other];
    for (const Observation& o : b.track) {
      if (Sees(a, o.photo)) return false;
    }
    TriangulatedPoint both;
    std::merge(a.track.begin(), a.track.end(), b.track.begin(), b.track.end(),
               std::back_inserter(both.track));
    const double na = static_cast<double>(a.track.size()), nb = static_cast<double>(b.track.size());
    both.xyz = (na * a.xyz + nb * b.xyz) / (na + nb);
    const size_t size = both.track.size();
    Settle(photos_, both);
    if (both.track.size() < size) return false;
    points_[other].track.clear();
    Replace(index, std::move(both));
    return true;
  }

  const std::vector<PhotoRays>& photos_;
  const MatchGraph& graph_;
  std::vector<TriangulatedPoint> points_;
  std::vector<int> point_of_;  // [features], -1: none
};

std::vector<int> NumFeatures(const std::vector<PhotoRays>& photos) {
  std::vector<int> counts;
  for (const PhotoRays& photo : photos) counts.push_back(static_cast<int>(photo.points.size()));
  return counts;
}

}  // namespace

std::vector<VerifiedPhotoPair> VerifyPairs(const std::vector<PhotoRays>& photos,
                                           const std::vector<PhotoMatches>& pairs, int threads) {
  std::vector<VerifiedPhotoPair> verified(pairs.size());
  ParallelFor(threads, pairs.size(), [&](size_t i, int) {
    const PhotoMatches& pair = pairs[i];
    verified[i] = {
        pair.photo1, pair.photo2,
        VerifyMatches(photos[pair.photo1], photos[pair.photo2], pair.matches, kMaxErrorPx)};
  });
  std::erase_if(verified, [&](const VerifiedPhotoPair& pair) {
    return static_cast<int>(pair.matches.size()) < kMinInliers;
  });
  return verified;
}

TriangulatedPoint TriangulateTrack(const std::vector<PhotoRays>& photos,
                                   const std::vector<Observation>& track) {
  const double cos_of_min_angle = CosOf(kMinAngleDeg);
  const size_t pairs = track.size() * (track.size() - 1) / 2;
  const size_t stride = (pairs + kMaxHypotheses - 1) / kMaxHypotheses;
  TriangulatedPoint best;
  double best_cost = std::numeric_limits<double>::infinity();
  for (size_t i = 0, pair = 0; i < track.size(); ++i) {
    for (size_t j = i + 1; j < track.size(); ++j, ++pair) {
      if (pair % stride != 0) continue;
      if (RayOf(photos, track[i]).dot(RayOf(photos, track[j])) > cos_of_min_angle) continue;
      const Eigen::Vector3d xyz = MidPoint(photos, track[i], track[j]);
      double cost = 0;
      for (const Observation& o : track) {
        cost += std::min(kSquaredLimit, SquaredError(photos, o, xyz));
      }
      if (cost < best_cost) {
        best_cost = cost;
        best.xyz = xyz;
      }
    }
  }
  if (!std::isfinite(best_cost)) return {};
  best.track = Agreeing(photos, track, best.xyz);
  if (best.track.size() < 2) return {};
  // What agrees with the better point, once more from all of the track.
  best.xyz = Refine(photos, best.track, best.xyz);
  best.track = Agreeing(photos, track, best.xyz);
  Settle(photos, best);
  return best;
}

absl::StatusOr<std::vector<TriangulatedPoint>> TriangulatePairs(
    const std::vector<PhotoRays>& photos, const std::vector<VerifiedPhotoPair>& pairs, int threads,
    const CancelToken& cancel) {
  const MatchGraph graph(NumFeatures(photos), pairs);
  const std::vector<std::vector<Observation>> tracks = BuildTracks(graph, pairs);
  std::vector<std::vector<TriangulatedPoint>> points(tracks.size());
  ParallelFor(threads, tracks.size(), [&](size_t i, int) {
    if (!cancel.IsCancelled()) points[i] = PointsOfTrack(photos, tracks[i]);
  });
  PointSet set(photos, graph);
  for (std::vector<TriangulatedPoint>& of_track : points) {
    for (TriangulatedPoint& point : of_track) set.Add(std::move(point));
  }
  for (int round = 0; round < kRounds; ++round) {
    LITAGS_RETURN_IF_ERROR(cancel.Check());
    if (!set.CompleteAndJoin()) break;
  }
  return set.Take();
}

}  // namespace litags
