#ifndef LITAGS_ENGINE_PIPELINE_TRAINING_RUN_H_
#define LITAGS_ENGINE_PIPELINE_TRAINING_RUN_H_

#include <memory>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "engine/core/splats.h"
#include "engine/pipeline/context.h"
#include "engine/pipeline/held_out_photos.h"
#include "engine/pipeline/report.h"
#include "engine/pipeline/train_set.h"
#include "engine/pipeline/training_leg.h"
#include "engine/train/trainer.h"

namespace litags {

// Trains the scene of one job: steps, reports, snapshots, checkpoints in the work folder.
class TrainingRun {
 public:
  // `context`, `set` and `observer` must outlive the run. Goes on from the work folder's checkpoint
  // if it is of this capture and these options, else notes why not.
  static absl::StatusOr<std::unique_ptr<TrainingRun>> Start(const Context& context,
                                                            const TrainSet& set,
                                                            ReconstructObserver* observer);

  // Until the last iteration. CANCELLED after a checkpoint of what was done; INTERNAL as
  // Trainer::RollBack; errors of files.
  absl::Status Train();

  // After Train: reports the stage of saving, with the numbers of the end of training, which stay
  // with a finished job, and fills context.report.
  void Finish();

 private:
  TrainingRun(const Context& context, const TrainSet& set, Splats initial,
              ReconstructObserver* observer);

  absl::Status Resume();
  TrainingLeg NewLeg() const;
  double SecondsLeft() const;
  absl::Status TakeStep();
  void Account(const StepLosses& losses);
  absl::Status SaveCheckpoint();
  absl::Status RollBack(const absl::Status& fault);
  absl::Status Cancelled() const;
  void ReportPhotoSize();
  absl::Status Publish();
  absl::StatusOr<std::string> PreviewPng(const Model& model);
  absl::Status ScoreHeldOut(const Model& model, bool last);
  absl::Status FitHeldOut(const Model& model);
  std::vector<View> Views() const;
  void NoteNanRecoveries() const;
  void NoteRefinement() const;

  const Context& context_;
  const ReconstructOptions& options_;
  const TrainSet& set_;
  ReconstructObserver* observer_;
  const TrainOptions train_options_;
  const double extent_;
  Trainer trainer_;
  ModelRenderer renderer_;
  HeldOutPhotos held_out_;
  const std::string scene_path_, checkpoint_path_;
  TrainingLeg leg_;
  Progress progress_;
  int shrink_ = 0;  // Trainer::PhotoShrink() of the last iteration; 0: there was none
  double step_seconds_ = 0;
  double ssim_holdout_ = kNotMeasured;
};

}  // namespace litags

#endif  // LITAGS_ENGINE_PIPELINE_TRAINING_RUN_H_
