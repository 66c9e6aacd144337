// Points of the scene for photos with known cameras, from matched features: what COLMAP's
// point_triangulator does, but the same bytes for any number of threads.
#ifndef LITAGS_ENGINE_SFM_TRIANGULATE_H_
#define LITAGS_ENGINE_SFM_TRIANGULATE_H_

#include <Eigen/Core>
#include <vector>

#include "absl/status/statusor.h"
#include "engine/core/cancel.h"
#include "engine/sfm/photo_rays.h"
#include "engine/sfm/tracks.h"

namespace litags {

struct TriangulateOptions {
  double max_error_px = 4;  // of a match from its epipolar geometry, of a point from its features
                            // (COLMAP's filter_max_reproj_error and RANSAC's max_error)
  double min_angle_deg = 1.5;  // between some two rays of a point (COLMAP's filter_min_tri_angle)
  // Points of two photos only, for which just one epipolar line speaks. Choice: of those with a
  // mean error of 0.5 to 1 px a fifth are wrong in castle's `low`, beyond 1 px most; below 4
  // degrees half of fox's are more than 2 % off in depth.
  double max_pair_error_px = 0.5;
  double min_pair_angle_deg = 4;
  int min_matches = 15;  // of two photos that agree with the cameras (COLMAP's
                         // min_num_inliers); fewer are chance
  int threads = 0;       // 0: all cores
};

// A point and the features it is seen as, ascending by photo, one per photo.
struct TriangulatedPoint {
  Eigen::Vector3d xyz = Eigen::Vector3d::Zero();  // world
  double error = 0;                               // mean distance from its features, px
  std::vector<Observation> track;
};

// Matches of two photos, by index.
struct PhotoMatches {
  int photo1 = 0, photo2 = 0;
  std::vector<FeatureMatch> matches;
};

// Those of `pairs` that the cameras confirm, in their order.
std::vector<VerifiedPhotoPair> VerifyPairs(const std::vector<PhotoRays>& photos,
                                           const std::vector<PhotoMatches>& pairs,
                                           const TriangulateOptions& options);

// The point that most features of a track agree on, tried from pairs of rays, none at random, and
// then nearest to those features (Gauss-Newton). Its track is what agrees; empty if no two do.
TriangulatedPoint TriangulateTrack(const std::vector<PhotoRays>& photos,
                                   const std::vector<Observation>& track,
                                   const TriangulateOptions& options);

// Points of all verified matches: tracks are triangulated, split where their features disagree,
// completed by features matched to theirs, and joined where one point explains two tracks.
// The result does not depend on options.threads. CANCELLED.
absl::StatusOr<std::vector<TriangulatedPoint>> TriangulatePairs(
    const std::vector<PhotoRays>& photos, const std::vector<VerifiedPhotoPair>& pairs,
    const TriangulateOptions& options, const CancelToken& cancel);

}  // namespace litags

#endif  // LITAGS_ENGINE_SFM_TRIANGULATE_H_
