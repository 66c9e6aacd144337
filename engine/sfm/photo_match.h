// Raw matches of a capture: our matcher in place of COLMAP's.
#ifndef LITAGS_ENGINE_SFM_PHOTO_MATCH_H_
#define LITAGS_ENGINE_SFM_PHOTO_MATCH_H_

#include <functional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "engine/core/cancel.h"
#include "engine/sfm/colmap_database.h"
#include "engine/sfm/sfm.h"

namespace litags {

// Two images of the database, by name, that may see the same things.
struct NamePair {
  std::string name1, name2;
};

// Compares the features in COLMAP's database, whose images are numbered in the order of their
// photos (NumberImages). Pairs with fewer than kMinInliers matches are left
// out: they can never be verified. Ascending by photos. The result does not depend on
// options.threads.
//
// The tests are those of COLMAP's CPU matcher with its defaults (SiftMatching.max_distance 0.7,
// max_ratio 0.8, cross_check 1), but on the true nearest features; COLMAP 3.8 looks them up in
// random k-d trees, which miss some.
//
// `progress` gets fractions, in the calling thread. Errors: INTERNAL COLMAP_DATABASE for a damaged
// database; CANCELLED within a second.
absl::StatusOr<std::vector<ImageMatches>> ComparePhotos(
    const std::string& database_path, const SfmOptions& options, const CancelToken& cancel,
    const std::function<void(double)>& progress);

// ComparePhotos, stored in the database in place of what `matches` held. Returns the names.
absl::StatusOr<std::vector<NamePair>> MatchPhotos(const std::string& database_path,
                                                  const SfmOptions& options,
                                                  const CancelToken& cancel,
                                                  const std::function<void(double)>& progress);

}  // namespace litags

#endif  // LITAGS_ENGINE_SFM_PHOTO_MATCH_H_
