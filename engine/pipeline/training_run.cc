#include "engine/pipeline/training_run.h"

#include <algorithm>
#include <filesystem>
#include <utility>

#include "absl/memory/memory.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "engine/core/counted.h"
#include "engine/core/error.h"
#include "engine/core/monotonic_seconds.h"
#include "engine/core/simd_target.h"
#include "engine/io/picture_io.h"
#include "engine/pipeline/scene_file.h"
#include "engine/train/camera_pose.h"
#include "engine/train/fit_camera.h"
#include "engine/train/initialize.h"

namespace litags {
namespace {

constexpr double kReportSeconds = 0.5;  // between progress reports
constexpr double kLossMemory = 0.98;    // of the running means of losses
constexpr char kFromTheBeginning[] = "training starts from the beginning";

absl::StatusOr<Splats> InitialSplats(const Recipe& recipe, const TrainSet& set) {
  return InitializeFromPoints(set.points, set.point_views, set.train,
                              recipe.dense_start ? StartShape::kDisk : StartShape::kBall);
}

TrainOptions TrainOptionsOf(const Context& context, const TrainSet& set) {
  TrainOptions train;
  train.recipe = AdaptToNoise(context.recipe, set.target_noise);
  train.iterations = context.options.ScheduleIterations();  // it is stepped from outside
  train.seed = context.options.seed;
  train.threads = context.options.threads;
  train.sh_degree = context.options.sh_degree;
  train.max_gaussians = context.options.max_gaussians;
  train.near_plane = set.near_plane;
  train.refine_cameras = context.options.refine_cameras;
  return train;
}

}  // namespace

absl::StatusOr<std::unique_ptr<TrainingRun>> TrainingRun::Start(const Context& context,
                                                                const TrainSet& set,
                                                                ReconstructObserver* observer) {
  LITAGS_ASSIGN_OR_RETURN(Splats initial, InitialSplats(context.recipe, set));
  auto run = absl::WrapUnique(new TrainingRun(context, set, std::move(initial), observer));
  LITAGS_RETURN_IF_ERROR(run->Resume());
  return run;
}

TrainingRun::TrainingRun(const Context& context, const TrainSet& set, Splats initial,
                         ReconstructObserver* observer)
    : context_(context),
      options_(context.options),
      set_(set),
      observer_(observer),
      train_options_(TrainOptionsOf(context, set)),
      extent_(SceneExtent(set.train)),
      trainer_(train_options_, &set.train, std::move(initial), extent_),
      renderer_(context.options.threads),
      held_out_(&set.holdout, context.options.threads),
      scene_path_(context.input.work_dir + "/scene.litags"),
      checkpoint_path_(context.input.work_dir + "/checkpoint.litags") {
  progress_.stage = Stage::kTraining;
  progress_.iterations = options_.iterations;
}

absl::Status TrainingRun::Resume() {
  std::error_code error;  // reading says what is wrong
  if (!std::filesystem::exists(checkpoint_path_, error) && !error) {
    if (std::filesystem::exists(scene_path_, error)) {
      context_.Note(absl::StrCat("an earlier run left no checkpoint; ", kFromTheBeginning));
    }
    return absl::OkStatus();
  }
  const absl::Status status =
      trainer_.LoadCheckpoint(checkpoint_path_, set_.fingerprint, options_.iterations);
  const auto detail = GetErrorDetail(status);
  if (detail.has_value() && detail->reason == "CHECKPOINT_MISMATCH") {
    context_.Note(
        absl::StrCat("a checkpoint of other photos or options was found; ", kFromTheBeginning));
    return absl::OkStatus();
  }
  // A job must not fail for ever because of its leftovers.
  if (IsOfNoUse(status)) {
    context_.Note(absl::StrCat("the checkpoint could not be used (", status.message(), "); ",
                               kFromTheBeginning));
    return absl::OkStatus();
  }
  LITAGS_RETURN_IF_ERROR(status);
  context_.Note(absl::StrCat("resumed at iteration ", trainer_.iteration()));
  const std::string& before = trainer_.checkpoint_target();
  if (!before.empty() && before != SimdTarget()) {
    context_.Note(absl::StrCat("earlier iterations ran with ", before, ", these with ",
                               SimdTarget(), " instructions: the scene is as good as that of one ",
                               "machine, but not the same byte for byte"));
  }
  return absl::OkStatus();
}

absl::Status TrainingRun::Train() {
  context_.report->first_iteration = trainer_.iteration();
  progress_.iteration = trainer_.iteration();
  progress_.gaussians = static_cast<int64_t>(trainer_.num_gaussians());
  leg_ = NewLeg();
  double last_report = 0;
  while (trainer_.iteration() < options_.iterations) {
    if (context_.cancel.IsCancelled()) return Cancelled();
    ReportPhotoSize();
    const absl::Status stepped = TakeStep();
    if (!stepped.ok()) {
      LITAGS_RETURN_IF_ERROR(RollBack(stepped));
      continue;
    }
    const int done = trainer_.iteration();
    const bool last = done == options_.iterations;
    if (done % options_.checkpoint_every == 0 || last) LITAGS_RETURN_IF_ERROR(SaveCheckpoint());
    if (last) break;
    const bool preview = done % options_.preview_every == 0;
    if (!preview && MonotonicSeconds() - last_report <= kReportSeconds) continue;
    progress_.eta_seconds = SecondsLeft();
    if (preview) {
      LITAGS_RETURN_IF_ERROR(Publish());
    } else {
      observer_->OnProgress(progress_);
    }
    last_report = MonotonicSeconds();
  }
  return Publish();
}

void TrainingRun::Finish() {
  Progress saving = progress_;
  saving.stage = Stage::kSaving;
  saving.message = "writing the report";
  observer_->OnProgress(saving);
  NoteNanRecoveries();
  if (options_.refine_cameras) NoteRefinement();
  ReconstructReport* report = context_.report;
  report->gaussians = static_cast<int64_t>(trainer_.num_gaussians());
  if (report->gaussians == 1) {
    context_.Note(absl::StrCat(
        "training removed all Gaussians but ", report->gaussians,
        ", since they had become transparent: the scene shows nothing; check whether the cameras "
        "fit the photos"));
  }
  report->iterations = trainer_.iteration();
  report->training_seconds = step_seconds_;
  const PhaseSeconds& phases = trainer_.phases();
  report->phase_seconds = {{"forward", phases.forward},
                           {"losses", phases.losses - phases.denoise},
                           {"denoise", phases.denoise},
                           {"backward", phases.backward},
                           {"density", phases.density}};
  report->psnr_holdout = progress_.psnr_holdout;
  report->ssim_holdout = ssim_holdout_;
  report->scene_path = scene_path_;
}

TrainingLeg TrainingRun::NewLeg() const {
  return {.start = MonotonicSeconds(), .first = trainer_.iteration()};
}

double TrainingRun::SecondsLeft() const {
  const int done = trainer_.iteration(), last = options_.iterations;
  const WorkForecast forecast = trainer_.Forecast(last);
  double seconds =
      leg_.SecondsLeft(MonotonicSeconds(), done, last, forecast, options_.checkpoint_every);
  if (options_.refine_cameras) {
    // Steps of FitCameras count as iterations of the end, though some are cheaper.
    const double of_step = forecast.work - trainer_.Forecast(last - 1).work;
    seconds +=
        leg_.SecondsOfWork(of_step) * kFitSteps * static_cast<double>(held_out_.views().size());
  }
  return seconds;
}

absl::Status TrainingRun::TakeStep() {
  const double start = MonotonicSeconds();
  const absl::StatusOr<StepLosses> losses = trainer_.Step();
  const double seconds = MonotonicSeconds() - start;
  step_seconds_ += seconds;
  leg_.step_seconds += seconds;
  LITAGS_RETURN_IF_ERROR(losses.status());
  Account(*losses);
  return absl::OkStatus();
}

void TrainingRun::Account(const StepLosses& losses) {
  const int done = trainer_.iteration();
  const double seconds = MonotonicSeconds() - leg_.start;
  progress_.iteration = done;
  progress_.gaussians = static_cast<int64_t>(trainer_.num_gaussians());
  progress_.iterations_per_second = (done - leg_.first) / std::max(seconds, 1e-9);
  leg_.work += trainer_.LastWork();
  if (losses.skipped) return;
  const double keep = progress_.loss == 0 ? 0.0 : kLossMemory;
  const auto mix = [&](double* mean, double value) { *mean = keep * *mean + (1 - keep) * value; };
  mix(&progress_.loss, losses.Total());
  mix(&progress_.loss_exposure, losses.exposure);
  mix(&progress_.loss_reconstruction, losses.reconstruction);
  mix(&progress_.loss_structure, losses.prior + losses.depth);
  mix(&progress_.loss_denoise, losses.denoise);
}

absl::Status TrainingRun::SaveCheckpoint() {
  const double start = MonotonicSeconds();
  LITAGS_RETURN_IF_ERROR(trainer_.SaveCheckpoint(checkpoint_path_, set_.fingerprint));
  leg_.checkpoint_seconds += MonotonicSeconds() - start;
  leg_.checkpoint_gaussians += static_cast<double>(trainer_.num_gaussians());
  return absl::OkStatus();
}

// Back to the last checkpoint, or to the start, and around what went wrong.
absl::Status TrainingRun::RollBack(const absl::Status& fault) {
  LITAGS_ASSIGN_OR_RETURN(Splats initial, InitialSplats(context_.recipe, set_));
  LITAGS_RETURN_IF_ERROR(trainer_.RollBack(checkpoint_path_, set_.fingerprint, std::move(initial)));
  Progress progress = progress_;
  progress.iteration = trainer_.iteration();
  progress.message = absl::StrCat(fault.message(), "; going on from iteration ",
                                  trainer_.iteration(), ", around it");
  observer_->OnProgress(progress);
  leg_ = NewLeg();
  return absl::OkStatus();
}

// Keeps what was done, so that a resumed job goes on from here. Where that fails it goes on from
// the checkpoint before.
absl::Status TrainingRun::Cancelled() const {
  if (trainer_.iteration() > leg_.first) {
    trainer_.SaveCheckpoint(checkpoint_path_, set_.fingerprint).IgnoreError();
  }
  return context_.cancel.Check();
}

// Coarse to fine: the loss of larger photos is a larger one, which looks like a setback.
void TrainingRun::ReportPhotoSize() {
  const int shrink = trainer_.PhotoShrink(), before = std::exchange(shrink_, shrink);
  if (before == 0 || before == shrink) return;
  progress_.loss = 0;  // so that all means start anew
  Progress change = progress_;
  change.message =
      absl::StrCat("photos are now at ", shrink > 1 ? absl::StrCat("1/", shrink) : "full",
                   " size; the loss starts anew");
  observer_->OnProgress(change);
}

// Saves a snapshot and reports it, after a preview picture and the held-out PSNR.
absl::Status TrainingRun::Publish() {
  Model model = trainer_.Snapshot();
  model.origin = set_.origin;
  if (model.lita && context_.recipe.noise_filter) model.noise = set_.noise;
  if (model.lita) model.curve = set_.curve;
  const bool last = trainer_.iteration() >= options_.iterations;
  if (options_.refine_cameras && last) LITAGS_RETURN_IF_ERROR(FitHeldOut(model));
  if (last) progress_.eta_seconds = 0;
  LITAGS_RETURN_IF_ERROR(SaveScene(scene_path_, model, Views()));
  LITAGS_RETURN_IF_ERROR(ScoreHeldOut(model, last));
  LITAGS_ASSIGN_OR_RETURN(const std::string png, PreviewPng(model));
  Progress progress = progress_;
  progress.preview_png.assign(png.begin(), png.end());
  // Before the snapshot: that is of the iteration which was told last.
  observer_->OnProgress(progress);
  observer_->OnSnapshot(scene_path_);
  return absl::OkStatus();
}

// Of the first held-out photo's camera, or of another photo's where none is held out.
absl::StatusOr<std::string> TrainingRun::PreviewPng(const Model& model) {
  Planes color;
  Camera shown = held_out_.views().empty() ? trainer_.CameraOf(0) : held_out_.views()[0].camera;
  const double shrink = double(kMaxPreviewSide) / std::max(shown.width, shown.height);
  if (shrink < 1) {
    const auto side = [&](int px) { return std::max(1, static_cast<int>(px * shrink)); };
    shown = shown.Scaled(side(shown.width), side(shown.height));
  }
  renderer_.RenderColor(model, shown, &color);
  return EncodePng(ToImageU8(color));
}

absl::Status TrainingRun::ScoreHeldOut(const Model& model, bool last) {
  // Where cameras are refined, those of held-out photos only tell at the end what pictures are.
  if (options_.refine_cameras && !last) return absl::OkStatus();
  const absl::StatusOr<HeldOutScores> scores =
      last ? held_out_.ScoreAll(renderer_, model, context_.cancel)
           : held_out_.ScoreSome(renderer_, model, context_.cancel);
  if (!last && absl::IsCancelled(scores.status())) return absl::OkStatus();  // Train sees it
  LITAGS_RETURN_IF_ERROR(scores.status());
  progress_.psnr_holdout = scores->psnr;
  ssim_holdout_ = scores->ssim;
  return absl::OkStatus();
}

absl::Status TrainingRun::FitHeldOut(const Model& model) {
  const double start = MonotonicSeconds();
  const size_t n = held_out_.views().size();
  Progress progress = progress_;
  const auto report = [&](size_t placed) {
    // Before the first one is placed, what training's last report said is all that there is.
    if (placed > 0) {
      progress.eta_seconds = (MonotonicSeconds() - start) / static_cast<double>(placed) *
                             static_cast<double>(n - placed);
    }
    progress.message = absl::StrCat("placing held-out photos: ", placed, " of ", n);
    observer_->OnProgress(progress);
  };
  return held_out_.FitCameras(train_options_, model, extent_, report, context_.cancel,
                              &context_.report->notes);
}

// All photos' cameras as they are known now, by name.
std::vector<View> TrainingRun::Views() const {
  std::vector<View> views = held_out_.views();
  for (size_t i = 0; i < set_.train.size(); ++i) {
    views.push_back({set_.train[i].view.name, trainer_.CameraOf(i)});
  }
  std::sort(views.begin(), views.end(),
            [](const View& a, const View& b) { return a.name < b.name; });
  return views;
}

void TrainingRun::NoteNanRecoveries() const {
  const std::vector<NanRecovery>& nan_recoveries = trainer_.nan_recoveries();
  if (nan_recoveries.empty()) return;
  context_.Note(absl::StrCat("rolled back ", Counted(nan_recoveries.size(), "time"),
                             " because a number was not finite"));
  for (const NanRecovery& d : nan_recoveries) {
    context_.Note(absl::StrCat(
        "iteration ", d.iteration, ": ", d.source, "; ",
        d.gaussians ? "such Gaussians were made invisible" : "the photo's turn was skipped"));
  }
}

// How far the cameras of the learnt photos are from the given ones.
void TrainingRun::NoteRefinement() const {
  double turn_sum = 0, shift_sum = 0, most = 0;
  size_t farthest = 0;
  for (size_t i = 0; i < set_.train.size(); ++i) {
    const PoseDifference d = DifferenceOf(set_.train[i].view.camera, trainer_.CameraOf(i));
    turn_sum += d.degrees;
    shift_sum += d.distance;
    if (d.distance > most) farthest = i;
    most = std::max(most, d.distance);
  }
  const auto n = static_cast<double>(set_.train.size());
  context_.Note(absl::StrFormat(
      "cameras were refined: turned by %.3f degrees and moved by %.4g in the mean, the farthest "
      "by %.4g (%s), in the unit of the given cameras; the scene's extent is %.4g",
      turn_sum / n, shift_sum / n, most, set_.train[farthest].view.name, extent_));
}

}  // namespace litags
