// One rung of the ladder: photos prepared in one way, through COLMAP, back as a model.
#ifndef LITAGS_ENGINE_SFM_RUNG_H_
#define LITAGS_ENGINE_SFM_RUNG_H_

#include <functional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "engine/core/cancel.h"
#include "engine/sfm/exposure.h"
#include "engine/sfm/photo_set.h"
#include "engine/sfm/sfm.h"

namespace litags {

// What a rung works with; the references must outlive it.
struct RungInput {
  const std::string& images_dir;
  const std::vector<PhotoFile>& photos;
  const SfmOptions& options;
  const CancelToken& cancel;
  Preparation preparation;
  std::string dir;  // made anew; logs stay in it
  std::function<void(const char* step, double fraction)> report;
};

struct RungOutput {
  SfmRung rung;
  SparseModel model;               // of the photos, not of the copies; no views if none came out
  std::vector<SfmPhoto> photos;    // every photo, in the order of RungInput::photos
  std::vector<std::string> notes;  // what the user should know
};

// Cameras and points from nothing. Where that leaves photos out, or finds another focal length than
// EXIF says, it starts a second time from EXIF's; where a lens draws the photos' corners in as
// fisheyes do, it starts again with a fisheye. Kept is what has more photos, else what has more
// sightings of points and no larger error.
absl::StatusOr<RungOutput> MapPhotos(const RungInput& input);

// Points for known cameras. `cameras.views[i]` is the camera of input.photos[i].
absl::StatusOr<RungOutput> TriangulatePhotos(const RungInput& input, const SparseModel& cameras);

}  // namespace litags

#endif  // LITAGS_ENGINE_SFM_RUNG_H_
