// Where COLMAP found features.
#ifndef LITAGS_ENGINE_SFM_COLMAP_KEYPOINTS_H_
#define LITAGS_ENGINE_SFM_COLMAP_KEYPOINTS_H_

#include <Eigen/Core>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "engine/sfm/colmap_database.h"

namespace litags {

// Where the features of each image lie, px from the corner of the top-left pixel; none for an image
// without features. INTERNAL COLMAP_DATABASE if they are damaged.
absl::StatusOr<std::vector<std::vector<Eigen::Vector2d>>> ReadKeypoints(
    const std::string& path, const std::vector<DatabaseImage>& images);

}  // namespace litags

#endif  // LITAGS_ENGINE_SFM_COLMAP_KEYPOINTS_H_
