// The steps that both kinds of rung share.
#ifndef LITAGS_ENGINE_SFM_RUNG_STEPS_H_
#define LITAGS_ENGINE_SFM_RUNG_STEPS_H_

#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "engine/sfm/colmap.h"
#include "engine/sfm/colmap_database.h"
#include "engine/sfm/rung.h"

namespace litags {

// Copies and their features, in a database whose images are in the order of the photos.
absl::Status PrepareAndExtract(const RungInput& in, Colmap& colmap, SfmRung& rung);

// Features and photos with a verified match of every photo.
absl::StatusOr<std::vector<SfmPhoto>> PhotoFacts(const RungInput& in,
                                                 const std::vector<DatabaseImage>& images,
                                                 const std::vector<VerifiedPair>& pairs);

// Puts the tracks of a model of copies, whose view i is of photo `photo_of[i]`, into the photos'
// px.
void ScaleTracks(const std::vector<PhotoFile>& photos, const std::vector<int>& photo_of,
                 SparseModel& model);

}  // namespace litags

#endif  // LITAGS_ENGINE_SFM_RUNG_STEPS_H_
