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

// Those of `pairs` of which the cameras confirm kMinInliers matches, in their order. threads 0: all
// cores.
std::vector<VerifiedPhotoPair> VerifyPairs(const std::vector<PhotoRays>& photos,
                                           const std::vector<PhotoMatches>& pairs, int threads);

// The point that most features of a track agree on, tried from pairs of rays, none at random, and
// then nearest to those features (Gauss-Newton). Its track is what agrees; empty if no two do.
TriangulatedPoint TriangulateTrack(const std::vector<PhotoRays>& photos,
                                   const std::vector<Observation>& track);

// Points of all verified matches: tracks are triangulated, split where their features disagree,
// completed by features matched to theirs, and joined where one point explains two tracks.
// The result does not depend on `threads`, 0: all cores. CANCELLED.
absl::StatusOr<std::vector<TriangulatedPoint>> TriangulatePairs(
    const std::vector<PhotoRays>& photos, const std::vector<VerifiedPhotoPair>& pairs, int threads,
    const CancelToken& cancel);

}  // namespace litags

#endif  // LITAGS_ENGINE_SFM_TRIANGULATE_H_
