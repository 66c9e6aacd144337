// The parts of COLMAP's SQLite database that its commands do not tell.
#ifndef LITAGS_ENGINE_SFM_COLMAP_DATABASE_H_
#define LITAGS_ENGINE_SFM_COLMAP_DATABASE_H_

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "engine/core/camera.h"
#include "engine/io/sparse_model.h"

namespace litags {

struct DatabaseImage {
  int id = 0;        // COLMAP's, from 1
  std::string name;  // path under the image folder
  int features = 0;
};

// Two images, by id, whose matches agree on one relative pose.
struct VerifiedPair {
  int id1 = 0, id2 = 0;
  int inliers = 0;
};

// In id order. INTERNAL COLMAP_DATABASE if the file is not a COLMAP 3.8 database.
absl::StatusOr<std::vector<DatabaseImage>> ReadDatabaseImages(const std::string& path);

// Pairs with at least `min_inliers` verified matches.
absl::StatusOr<std::vector<VerifiedPair>> ReadVerifiedPairs(const std::string& path,
                                                            int min_inliers);

// Gives every image its known intrinsics, one database camera each, marked as known so that
// matches are verified with them. `model.views` hold the images' names and sizes.
absl::Status SetKnownCameras(const std::string& path, const SparseModel& model);

}  // namespace litags

#endif  // LITAGS_ENGINE_SFM_COLMAP_DATABASE_H_
