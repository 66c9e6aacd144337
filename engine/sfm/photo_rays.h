// A photo whose camera is known, in the terms of epipolar geometry: everything in the pixels that a
// lens without distortion would have given.
#ifndef LITAGS_ENGINE_SFM_PHOTO_RAYS_H_
#define LITAGS_ENGINE_SFM_PHOTO_RAYS_H_

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "engine/core/camera.h"
#include "engine/io/sparse_model.h"
#include "engine/sfm/descriptor_match.h"

namespace litags {

// Where the feature at `seen`, px of the photo as taken, lies without lens distortion, px; nothing
// where the lens puts no point (see Undistort).
std::optional<Eigen::Vector2d> UndistortPoint(const Camera& camera, const Distortion& distortion,
                                              const Eigen::Vector2d& seen);

struct PhotoRays {
  // `keypoints` [n], px of the photo as taken.
  PhotoRays(const Camera& camera, const Distortion& distortion,
            const std::vector<Eigen::Vector2d>& keypoints);

  Eigen::Matrix3d K, R;  // x_cam = R x_world + t
  Eigen::Vector3d t;
  Eigen::Vector3d center;  // world
  // [n] undistorted, px; NaN where the lens puts no point: no match of such a feature is verified.
  std::vector<Eigen::Vector2d> points;
  std::vector<Eigen::Vector3d> rays;  // [n] from the centre through the point, world, length 1
  // [n] the first feature at the same place: SIFT gives a place with two orientations two features.
  std::vector<int> twin_of;

  Eigen::Vector3d CamFromWorld(const Eigen::Vector3d& world) const { return R * world + t; }
};

// The fundamental matrix of two photos: x_second^T F x_first = 0, homogeneous px. Zero if both were
// taken from one place.
Eigen::Matrix3d FundamentalMatrix(const PhotoRays& first, const PhotoRays& second);

// Sampson's distance from the epipolar geometry, px; infinite for a zero matrix.
double SampsonError(const Eigen::Matrix3d& fundamental, const Eigen::Vector2d& first,
                    const Eigen::Vector2d& second);

// A match that agrees with the cameras.
struct VerifiedMatch {
  int feature1 = 0, feature2 = 0;  // of twins the first
  double error = 0;                // Sampson, px
};

// Those of `matches` within `max_error_px` of the epipolar geometry and in front of both cameras;
// ascending by features, each pair of features once.
std::vector<VerifiedMatch> VerifyMatches(const PhotoRays& first, const PhotoRays& second,
                                         const std::vector<FeatureMatch>& matches,
                                         double max_error_px);

}  // namespace litags

#endif  // LITAGS_ENGINE_SFM_PHOTO_RAYS_H_
