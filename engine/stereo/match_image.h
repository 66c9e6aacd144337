// What stereo compares: a photo's brightness, freed of exposure as far as one view can tell.
#ifndef LITAGS_ENGINE_STEREO_MATCH_IMAGE_H_
#define LITAGS_ENGINE_STEREO_MATCH_IMAGE_H_

#include "absl/status/statusor.h"
#include "engine/core/camera.h"
#include "engine/core/photo.h"

namespace litags {

struct MatchImage {
  Camera camera;    // of `gray`'s size
  Planes gray;      // [1, h, w], mean about 0
  float noise = 0;  // standard deviation of the noise of `gray`, where nothing cuts it off
};

// The photo shrunk to the size of `camera` by averaging linear light, which is what makes a dark
// photo's noise bearable; smoothed a little; then the square root of brightness over its mean,
// under which photon noise has one size everywhere. An all-black photo gives a flat image. INTERNAL
// if OpenCV fails.
absl::StatusOr<MatchImage> MakeMatchImage(const Photo& photo, const Camera& camera);

}  // namespace litags

#endif  // LITAGS_ENGINE_STEREO_MATCH_IMAGE_H_
