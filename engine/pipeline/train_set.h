// The last stage before training: all that it learns from.
#ifndef LITAGS_ENGINE_PIPELINE_TRAIN_SET_H_
#define LITAGS_ENGINE_PIPELINE_TRAIN_SET_H_

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "engine/core/code_curve.h"
#include "engine/core/noise_curve.h"
#include "engine/io/sparse_model.h"
#include "engine/pipeline/context.h"
#include "engine/train/noise.h"
#include "engine/train/train_view.h"

namespace litags {

struct TrainSet {
  std::vector<TrainView> train;
  std::vector<TrainView> holdout;   // evaluated only
  std::vector<SparsePoint> points;  // to start from
  std::vector<int> point_views;     // model view to index in `train`, -1 if held out or left out
  TargetNoise target_noise;         // of `train`
  NoiseCurve noise = {};  // of pictures: what rounding and the photos' own noise leave in them
  std::optional<CodeCurve> curve;  // for pictures, which takes off how black brightens noisy photos
  float near_plane = 0;            // as NearPlaneOf has it
  std::array<double, 3> origin = {};  // of all this, in the coordinates that the cameras came in
  std::string fingerprint;            // of photos, cameras and the options that shape the result
};

// Photos -> PosedPhotos -> CaptureTargets -> depth maps -> TrainSet: every stage is made from the
// ones before and never changed. Cameras that were found, depth and points of stereo are kept in
// the work folder, so that a second call gives the same set. Points beyond max_gaussians are left
// out, with a note. Errors are those of the stages. `colmap` is the program's name or path.
absl::StatusOr<TrainSet> MakeTrainSet(const Context& context, const std::string& colmap);

}  // namespace litags

#endif  // LITAGS_ENGINE_PIPELINE_TRAIN_SET_H_
