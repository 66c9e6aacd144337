// From files to a capture that can be trained on: photos, cameras, sparse points, priors.
#ifndef LITAGS_ENGINE_PIPELINE_CAPTURE_H_
#define LITAGS_ENGINE_PIPELINE_CAPTURE_H_

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "engine/core/code_curve.h"
#include "engine/denoise/noise_filter.h"
#include "engine/io/sparse_model.h"
#include "engine/pipeline/context.h"
#include "engine/train/noise.h"
#include "engine/train/train_view.h"

namespace litags {

struct Capture {
  std::vector<TrainView> train;
  std::vector<TrainView> holdout;  // evaluated only
  std::vector<SparsePoint> points;
  std::vector<int> point_views;  // model view to index in `train`, -1 if held out or left out
  TargetNoise target_noise;      // of `train`
  NoiseCurve noise = {};  // of pictures: what rounding and the photos' own noise leave in them
  std::optional<CodeCurve> curve;  // for pictures, which takes off how black brightens noisy photos
  std::array<double, 3> origin = {};  // of all this, in the coordinates that the cameras came in
  std::string fingerprint;            // of photos, cameras and the options that shape the result
};

// Loads photos and cameras (running COLMAP where needed), makes pseudo-targets and structure
// maps. Cameras that were found are kept in work_dir/cameras, so that a second call gives the same
// capture. Photos of a single colour are left out, points beyond max_gaussians too, with a note.
// Fills the registration part of the report. FAILED_PRECONDITION (TOO_FEW_PHOTOS) if fewer than
// kMinPhotos remain. `colmap` is the program's name or path.
absl::StatusOr<Capture> LoadCapture(const Context& context, const std::string& colmap);

}  // namespace litags

#endif  // LITAGS_ENGINE_PIPELINE_CAPTURE_H_
