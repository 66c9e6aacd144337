// Telling a camera that turned in place from one that moved: without parallax there is no scene to
// reconstruct, though COLMAP may find one, with focal lengths that are not there.
#ifndef LITAGS_ENGINE_SFM_TURNING_H_
#define LITAGS_ENGINE_SFM_TURNING_H_

#include <Eigen/Core>
#include <vector>

#include "absl/status/statusor.h"
#include "engine/core/cancel.h"

namespace litags {

// Where two photos see the same things, px from the middle of each.
struct SeenTwice {
  std::vector<Eigen::Vector2d> first, second;  // of one size, at least one
};

// Whether rotations of a camera with one focal length explain the matches of all pairs to two
// pixels: medians over a pair's matches, and over the pairs. `longer_side` of the photos, px. A
// wall that the camera walks along looks so too, but with a focal length beyond all that are tried.
// False without pairs. CANCELLED on request.
absl::StatusOr<bool> TurnedInPlace(const std::vector<SeenTwice>& pairs, double longer_side,
                                   const CancelToken& cancel);

}  // namespace litags

#endif  // LITAGS_ENGINE_SFM_TURNING_H_
