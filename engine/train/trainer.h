// The optimisation loop (LITA-GS Sec. "Unsupervised Optimization Strategy"), one photo an
// iteration, or a crop of one (recipe.crop_pixels).
#ifndef LITAGS_ENGINE_TRAIN_TRAINER_H_
#define LITAGS_ENGINE_TRAIN_TRAINER_H_

#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "engine/core/splats.h"
#include "engine/train/model.h"
#include "engine/train/nan_recovery.h"
#include "engine/train/options.h"
#include "engine/train/step_losses.h"
#include "engine/train/train_view.h"
#include "engine/train/work_forecast.h"

namespace litags {

// Wall-clock seconds since the start, by phase.
struct PhaseSeconds {
  double forward = 0, denoise = 0, losses = 0, backward = 0, density = 0;
};

// Of what Trainer::LoadCheckpoint returned: whether the checkpoint is not there, damaged, of an
// older program or of another run, so that training begins anew. Any other error may be one of a
// good checkpoint: one that cannot be read now, that a newer program can read, or that has more
// iterations than are wanted.
bool IsOfNoUse(const absl::Status& loaded);

// Trains one scene. Everything random is a function of (seed, iteration), so the result is the same
// bytes for any thread count and across checkpoint and resume, on one SIMD target.
class Trainer {
 public:
  // `views` must outlive the trainer; `options` valid; at least one view. `initial` from
  // InitializeFromPoints, `extent` from SceneExtent.
  Trainer(const TrainOptions& options, const std::vector<TrainView>* views, Splats initial,
          double extent);
  ~Trainer();

  // One iteration. INTERNAL (NOT_FINITE) if a loss, a gradient or a parameter is not finite, naming
  // it with the photo and the iteration. The scene may then be half updated: RollBack, or
  // LoadCheckpoint, is the only way on.
  absl::StatusOr<StepLosses> Step();

  // After NOT_FINITE: back to the checkpoint at `path`, or to `initial` (as the constructor got it)
  // if it is none of this run, and around what was met there: see NanRecovery. A photo that was
  // skipped twice is not used again. Iterations in between are repeated exactly, so the result does
  // not depend on where the run went back to. INTERNAL (NOT_FINITE) after kMaxNanRecoveries, or
  // when more than half of the photos would be left out; the file's error if the checkpoint is
  // there and IsOfNoUse() does not hold. After an error this trainer is of no more use.
  absl::Status RollBack(const std::string& path, const std::string& fingerprint, Splats initial);

  // What was met so far, by iteration; part of checkpoints.
  const std::vector<NanRecovery>& nan_recoveries() const;

  int iteration() const;  // finished iterations
  size_t num_gaussians() const;
  const PhaseSeconds& phases() const;

  // For estimates of time, in no unit: the work of the iteration done last, and that of those from
  // here to `end` as far as the growth of the scene can be foretold.
  double LastWork() const;
  WorkForecast Forecast(int end) const;

  // What the sides of photos are divided by in the next iteration, coarse to fine: 4, 2, at last 1.
  int PhotoShrink() const;

  // The camera of view `i`: as given, or as refined so far if the options want that. On average
  // refined cameras stay where the given ones were, so that world and unit stay, too.
  Camera CameraOf(size_t i) const;

  // A copy of the scene as it is.
  Model Snapshot() const;

  // Everything needed to go on, written atomically. `fingerprint` names photos and options;
  // LoadCheckpoint refuses another one, and one of more than `most_iterations`
  // (FAILED_PRECONDITION; CHECKPOINT_MISMATCH, CHECKPOINT_TOO_LONG), and then changes nothing. A
  // resumed run ends with the bytes of one never interrupted, if it is on one SIMD target.
  absl::Status SaveCheckpoint(const std::string& path, const std::string& fingerprint) const;
  absl::Status LoadCheckpoint(const std::string& path, const std::string& fingerprint,
                              int most_iterations = std::numeric_limits<int>::max());

  // SIMD target that the checkpoint loaded last was saved on; empty: none was, or it does not say.
  const std::string& checkpoint_target() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace litags

#endif  // LITAGS_ENGINE_TRAIN_TRAINER_H_
