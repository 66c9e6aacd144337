#include "engine/pipeline/engine.h"

#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <limits>
#include <opencv2/core/utility.hpp>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "engine/core/counted.h"
#include "engine/core/error.h"
#include "engine/core/mask.h"
#include "engine/core/parallel.h"
#include "engine/core/simd_target.h"
#include "engine/eval/metrics.h"
#include "engine/io/file_util.h"
#include "engine/io/image_io.h"
#include "engine/pipeline/camera_source.h"
#include "engine/pipeline/depth_maps.h"
#include "engine/pipeline/scene_file.h"
#include "engine/pipeline/train_set.h"
#include "engine/pipeline/video_frames.h"
#include "engine/pipeline/wide_views.h"
#include "engine/pipeline/work_folders.h"
#include "engine/train/camera_pose.h"
#include "engine/train/fit_camera.h"
#include "engine/train/initialize.h"
#include "engine/train/losses.h"
#include "engine/train/trainer.h"

namespace litags {
namespace {

constexpr size_t kScoredOfPreview = 16;  // held-out photos: rendering them takes long
constexpr double kReportSeconds = 0.5;   // between progress reports
constexpr double kLossMemory = 0.98;     // of the running means of losses

double Now() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

absl::StatusOr<Splats> InitialSplats(const Recipe& recipe, const TrainSet& set) {
  return InitializeFromPoints(set.points, set.point_views, set.train,
                              recipe.dense_start ? StartShape::kDisk : StartShape::kBall);
}

constexpr double kNotMeasured = std::numeric_limits<double>::quiet_NaN();

// Makes pixels that do not count equal, and returns how many there are for each that counts.
double FillUncounted(const PlaneU8& mask, const Planes& color, Planes* target) {
  for (int c = 0; c < target->channels; ++c) {
    ForMasked(mask, [&](size_t i) { target->plane(c)[i] = color.plane(c)[i]; });
  }
  return static_cast<double>(color.plane_size()) / CountedPixels(mask, color.plane_size());
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

// One training run: steps, reports, snapshots, checkpoints.
class Run {
 public:
  Run(const Context& context, const TrainSet& set, Splats initial, ReconstructObserver* observer)
      : options_(context.options),
        recipe_(context.recipe),
        set_(set),
        observer_(observer),
        train_options_(TrainOptionsOf(context, set)),
        extent_(SceneExtent(set.train)),
        trainer_(train_options_, &set.train, std::move(initial), extent_),
        renderer_(context.options.threads),
        scene_path_(context.input.work_dir + "/scene.litags"),
        checkpoint_path_(context.input.work_dir + "/checkpoint.litags") {
    for (const TrainView& v : set.holdout) held_out_.push_back(v.view);
    progress_.stage = Stage::kTraining;
    progress_.iterations = options_.iterations;
    progress_.psnr_holdout = kNotMeasured;
  }

  // Goes on from the checkpoint if there is one of this capture and these options.
  absl::Status Resume(std::vector<std::string>* notes) {
    if (!std::filesystem::exists(checkpoint_path_)) {
      if (std::filesystem::exists(scene_path_)) {
        notes->emplace_back(
            "an earlier run left no checkpoint; training starts from the beginning");
      }
      return absl::OkStatus();
    }
    const absl::Status status =
        trainer_.LoadCheckpoint(checkpoint_path_, set_.fingerprint, options_.iterations);
    const auto detail = GetErrorDetail(status);
    if (detail.has_value() && detail->reason == "CHECKPOINT_MISMATCH") {
      notes->emplace_back(
          "a checkpoint of other photos or options was found; training starts from the beginning");
      return absl::OkStatus();
    }
    // Damaged, foreign or too new: a job must not fail for ever because of its leftovers.
    if (absl::IsDataLoss(status) || absl::IsInvalidArgument(status) ||
        absl::IsFailedPrecondition(status)) {
      notes->push_back(absl::StrCat("the checkpoint could not be used (", status.message(),
                                    "); training starts from the beginning"));
      return absl::OkStatus();
    }
    LITAGS_RETURN_IF_ERROR(status);
    notes->push_back(absl::StrCat("resumed at iteration ", trainer_.iteration()));
    const std::string& before = trainer_.checkpoint_target();
    if (!before.empty() && before != SimdTarget()) {
      notes->push_back(absl::StrCat("earlier iterations ran with ", before, ", these with ",
                                    SimdTarget(), " instructions: the scene is as good as that of ",
                                    "one machine, but not the same byte for byte"));
    }
    return absl::OkStatus();
  }

  absl::Status Train(const CancelToken& cancel) {
    progress_.iteration = trainer_.iteration();
    progress_.gaussians = static_cast<int64_t>(trainer_.num_gaussians());
    Leg leg = NewLeg();
    double last_report = 0;
    while (trainer_.iteration() < options_.iterations) {
      if (cancel.IsCancelled()) return Cancelled(cancel, trainer_.iteration() > leg.first);
      ReportPhotoSize();
      const double step_start = Now();
      const absl::StatusOr<StepLosses> losses = trainer_.Step();
      const double step_seconds = Now() - step_start;
      step_seconds_ += step_seconds;
      leg.step_seconds += step_seconds;
      if (!losses.ok()) {
        LITAGS_RETURN_IF_ERROR(RollBack(losses.status()));
        leg = NewLeg();
        continue;
      }
      const int done = trainer_.iteration();
      Account(*losses, &leg);
      const bool last = done == options_.iterations;
      if (done % options_.checkpoint_every == 0 || last) {
        LITAGS_RETURN_IF_ERROR(SaveCheckpoint(&leg));
      }
      if (last) break;
      const bool preview = done % options_.preview_every == 0;
      if (!preview && Now() - last_report <= kReportSeconds) continue;
      progress_.eta_seconds = SecondsLeft(leg);
      if (preview) {
        LITAGS_RETURN_IF_ERROR(Publish(cancel));
      } else {
        observer_->OnProgress(progress_);
      }
      last_report = Now();
    }
    return Publish(cancel);
  }

  // What is reported last, and stays with a finished job: the numbers of the end of training.
  Progress Saving() const {
    Progress progress = progress_;
    progress.stage = Stage::kSaving;
    progress.message = "writing the report";
    return progress;
  }

  void Finish(ReconstructReport* report) {
    AddNanRecoveries(&report->notes);
    if (options_.refine_cameras) report->notes.push_back(DescribeRefinement());
    report->gaussians = static_cast<int64_t>(trainer_.num_gaussians());
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

 private:
  // Iterations without a roll-back between them; rates are those of one leg.
  struct Leg {
    double start;     // seconds
    int first;        // iteration
    double work = 0;  // Trainer::LastWork() of its iterations
    double step_seconds = 0;
    double checkpoint_seconds = 0, checkpoint_gaussians = 0;  // sums over its checkpoints
  };
  Leg NewLeg() const { return {Now(), trainer_.iteration()}; }

  // Iterations by their work, checkpoints by their Gaussians, previews as long as so far: of these
  // Gaussians are the smaller part. Steps of FitHeldOut count as iterations
  // of the end, though some are cheaper.
  double SecondsLeft(const Leg& leg) const {
    const int done = trainer_.iteration();
    const WorkForecast forecast = trainer_.Forecast(options_.iterations);
    double seconds = leg.step_seconds / leg.work * forecast.work;
    const double beside = Now() - leg.start - leg.step_seconds - leg.checkpoint_seconds;
    seconds += beside / (done - leg.first) * (options_.iterations - done);
    if (leg.checkpoint_gaussians > 0) {
      seconds += leg.checkpoint_seconds / leg.checkpoint_gaussians * forecast.gaussians /
                 options_.checkpoint_every;
    }
    if (options_.refine_cameras) {
      const double at_full_size = forecast.work - trainer_.Forecast(options_.iterations - 1).work;
      seconds += leg.step_seconds / leg.work * at_full_size * kFitSteps *
                 static_cast<double>(held_out_.size());
    }
    return seconds;
  }

  absl::Status SaveCheckpoint(Leg* leg) {
    const double start = Now();
    LITAGS_RETURN_IF_ERROR(trainer_.SaveCheckpoint(checkpoint_path_, set_.fingerprint));
    leg->checkpoint_seconds += Now() - start;
    leg->checkpoint_gaussians += static_cast<double>(trainer_.num_gaussians());
    return absl::OkStatus();
  }

  // Back to the last checkpoint, or to the start, and around what went wrong.
  absl::Status RollBack(const absl::Status& fault) {
    LITAGS_ASSIGN_OR_RETURN(Splats initial, InitialSplats(recipe_, set_));
    LITAGS_RETURN_IF_ERROR(
        trainer_.RollBack(checkpoint_path_, set_.fingerprint, std::move(initial)));
    Progress progress = progress_;
    progress.iteration = trainer_.iteration();
    progress.message = absl::StrCat(fault.message(), "; going on from iteration ",
                                    trainer_.iteration(), ", around it");
    observer_->OnProgress(progress);
    return absl::OkStatus();
  }

  void AddNanRecoveries(std::vector<std::string>* notes) const {
    const std::vector<NanRecovery>& nan_recoveries = trainer_.nan_recoveries();
    if (nan_recoveries.empty()) return;
    notes->push_back(absl::StrCat("rolled back ", Counted(nan_recoveries.size(), "time"),
                                  " because a number was not finite"));
    for (const NanRecovery& d : nan_recoveries) {
      notes->push_back(absl::StrCat(
          "iteration ", d.iteration, ": ", d.source, "; ",
          d.gaussians ? "such Gaussians were made invisible" : "the photo's turn was skipped"));
    }
  }

  // How far the cameras of the learnt photos are from the given ones.
  std::string DescribeRefinement() const {
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
    return absl::StrFormat(
        "cameras were refined: turned by %.3f degrees and moved by %.4g in the mean, the farthest "
        "by %.4g (%s), in the unit of the given cameras; the scene's extent is %.4g",
        turn_sum / n, shift_sum / n, most, set_.train[farthest].view.name, extent_);
  }

  // Keeps what was done, so that a resumed job goes on from here. Where that fails it goes on from
  // the checkpoint before.
  absl::Status Cancelled(const CancelToken& cancel, bool progressed) const {
    if (progressed) {
      trainer_.SaveCheckpoint(checkpoint_path_, set_.fingerprint).IgnoreError();
    }
    return cancel.Check();
  }

  void Account(const StepLosses& losses, Leg* leg) {
    const int done = trainer_.iteration(), steps = done - leg->first;
    const double seconds = Now() - leg->start;
    progress_.iteration = done;
    progress_.gaussians = static_cast<int64_t>(trainer_.num_gaussians());
    progress_.iterations_per_second = steps / std::max(seconds, 1e-9);
    leg->work += trainer_.LastWork();
    if (losses.skipped) return;
    const double keep = progress_.loss == 0 ? 0.0 : kLossMemory;
    const auto mix = [&](double* mean, double value) { *mean = keep * *mean + (1 - keep) * value; };
    mix(&progress_.loss, losses.Total());
    mix(&progress_.loss_exposure, losses.exposure);
    mix(&progress_.loss_reconstruction, losses.reconstruction);
    mix(&progress_.loss_structure, losses.prior + losses.depth);
    mix(&progress_.loss_denoise, losses.denoise);
  }

  // Coarse to fine: the loss of larger photos is a larger one, which looks like a setback.
  void ReportPhotoSize() {
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
  absl::Status Publish(const CancelToken& cancel) {
    Model model = trainer_.Snapshot();
    model.origin = set_.origin;
    if (model.lita && recipe_.noise_filter) model.noise = set_.noise;
    if (model.lita) model.curve = set_.curve;
    const bool last = trainer_.iteration() >= options_.iterations;
    if (options_.refine_cameras && last) LITAGS_RETURN_IF_ERROR(FitHeldOut(model, cancel));
    if (last) progress_.eta_seconds = 0;
    LITAGS_RETURN_IF_ERROR(SaveScene(scene_path_, model, Views()));
    LITAGS_ASSIGN_OR_RETURN(const std::string png, ScoreHeldOut(model, last, cancel));
    Progress progress = progress_;
    progress.preview_png.assign(png.begin(), png.end());
    // Before the snapshot: that is of the iteration which was told last.
    observer_->OnProgress(progress);
    observer_->OnSnapshot(scene_path_);
    return absl::OkStatus();
  }

  // All photos' cameras as they are known now, by name.
  std::vector<View> Views() const {
    std::vector<View> views = held_out_;
    for (size_t i = 0; i < set_.train.size(); ++i) {
      views.push_back({set_.train[i].view.name, trainer_.CameraOf(i)});
    }
    std::sort(views.begin(), views.end(),
              [](const View& a, const View& b) { return a.name < b.name; });
    return views;
  }

  // Photos that are not learnt do not move their cameras while the others move theirs.
  absl::Status FitHeldOut(const Model& model, const CancelToken& cancel) {
    const size_t n = held_out_.size();
    const double start = Now();
    Progress progress = progress_;
    for (size_t i = 0; i < n; ++i) {
      const double seconds = Now() - start;
      // Before the first one is placed, what training's last report said is all that there is.
      if (i > 0) {
        progress.eta_seconds = seconds / static_cast<double>(i) * static_cast<double>(n - i);
      }
      progress.message = absl::StrCat("placing held-out photos: ", i, " of ", n);
      observer_->OnProgress(progress);
      LITAGS_ASSIGN_OR_RETURN(held_out_[i].camera,
                              FitCamera(train_options_, model, set_.holdout[i], extent_, cancel));
    }
    return absl::OkStatus();
  }

  // Compares the held-out photos with pictures: all of them at the end, with SSIM, which takes
  // long; before, kScoredOfPreview spread over them. Returns the picture of the first one, as PNG,
  // or of another photo where none is held out.
  absl::StatusOr<std::string> ScoreHeldOut(const Model& model, bool last,
                                           const CancelToken& cancel) {
    Planes color, target;
    const Camera shown = held_out_.empty() ? trainer_.CameraOf(0) : held_out_[0].camera;
    renderer_.RenderColor(model, shown, &color);
    LITAGS_ASSIGN_OR_RETURN(std::string png, EncodePng(ToImageU8(color)));
    // Where cameras are refined, those of held-out photos only tell at the end what pictures are.
    if (held_out_.empty() || (options_.refine_cameras && !last)) return png;
    LossWorkspace workspace(options_.threads);
    double psnr_sum = 0, ssim_sum = 0;
    const size_t all = held_out_.size(), scored = last ? all : std::min(all, kScoredOfPreview);
    for (size_t k = 0; k < scored; ++k) {
      if (cancel.IsCancelled()) {
        if (last) return cancel.Check();
        return png;
      }
      const size_t i = k * all / scored;
      const TrainView& v = set_.holdout[i];
      if (i > 0 || v.lamp.power > 0) {
        renderer_.RenderColor(model, held_out_[i].camera, &color, v.lamp);
      }
      UnpackImage(v.target, workspace, &target);
      for (float& x : color.data) x = std::clamp(x, 0.0f, 1.0f);
      const double dilution = FillUncounted(v.mask, color, &target);
      LITAGS_ASSIGN_OR_RETURN(const double psnr, Psnr(color, target));
      psnr_sum += psnr - 10 * std::log10(dilution);
      if (!last) continue;
      // Not of photos below 11 px.
      const absl::StatusOr<double> ssim = Ssim(color, target, SsimBorder::kValid, options_.threads);
      ssim_sum += ssim.ok() ? 1 - (1 - *ssim) * dilution : kNotMeasured;
    }
    const auto count = static_cast<double>(scored);
    progress_.psnr_holdout = psnr_sum / count;
    if (last) ssim_holdout_ = ssim_sum / count;
    return png;
  }

  const ReconstructOptions& options_;
  const Recipe& recipe_;
  const TrainSet& set_;
  ReconstructObserver* observer_;
  TrainOptions train_options_;
  double extent_;
  Trainer trainer_;
  ModelRenderer renderer_;
  std::string scene_path_, checkpoint_path_;
  std::vector<View> held_out_;  // with cameras that are fitted at the end if others are refined
  Progress progress_;
  int shrink_ = 0;  // Trainer::PhotoShrink() of the last iteration; 0: there was none
  double step_seconds_ = 0;
  double ssim_holdout_ = kNotMeasured;
};

class SilentObserver : public ReconstructObserver {
 public:
  void OnProgress(const Progress&) override {}
  void OnSnapshot(const std::string&) override {}
};

// OpenCV has a pool of its own, as large as the machine unless it is told.
class OpenCvThreads {
 public:
  explicit OpenCvThreads(int threads) { cv::setNumThreads(threads); }
  ~OpenCvThreads() { cv::setNumThreads(before_); }
  OpenCvThreads(const OpenCvThreads&) = delete;
  OpenCvThreads& operator=(const OpenCvThreads&) = delete;

 private:
  const int before_ = cv::getNumThreads();
};

class RealEngine : public Engine {
 public:
  explicit RealEngine(std::string colmap) : colmap_(std::move(colmap)) {}

  absl::StatusOr<ReconstructReport> Reconstruct(const ReconstructInput& given,
                                                const ReconstructOptions& options,
                                                const CancelToken& cancel,
                                                ReconstructObserver* observer) override {
    LITAGS_RETURN_IF_ERROR(options.Validate());
    SilentObserver silent;
    if (observer == nullptr) observer = &silent;
    const double start = Now();
    LITAGS_RETURN_IF_ERROR(CheckInputsOutside(given));
    LITAGS_ASSIGN_OR_RETURN(const FolderLock lock, LockWorkDir(given.work_dir));
    const OpenCvThreads opencv(options.threads > 0 ? options.threads : DefaultThreadCount());
    // Of a run that was killed while it wrote.
    RemoveStaleTempFiles(given.work_dir);
    RemoveStaleTempFiles(given.work_dir + "/cameras");
    RemoveStaleTempFiles(SolvedFisheyes(given));
    ReconstructReport report;
    const auto progress = [&](Stage stage, const std::string& message) {
      Progress p;
      p.stage = stage;
      p.message = message;
      p.iterations = options.iterations;
      p.psnr_holdout = kNotMeasured;
      observer->OnProgress(p);
    };
    const auto loading = [&](const std::string& message) { progress(Stage::kLoading, message); };
    LITAGS_ASSIGN_OR_RETURN(
        const ReconstructInput photos,
        WithFramesAsPhotos(given, options.frames, cancel, loading, &report.notes));
    LITAGS_ASSIGN_OR_RETURN(
        const ReconstructInput input,
        WithViewsOfWidePhotos(photos, options.threads, cancel, loading, &report.notes));
    const Context context(input, options, cancel, progress, &report,
                          [observer](std::string_view line) { observer->OnLine(line); });
    LITAGS_RETURN_IF_ERROR(CheckDepthSource(context));
    LITAGS_ASSIGN_OR_RETURN(const TrainSet set, MakeTrainSet(context, colmap_));
    LITAGS_ASSIGN_OR_RETURN(Splats initial, InitialSplats(context.recipe, set));
    Run run(context, set, std::move(initial), observer);
    LITAGS_RETURN_IF_ERROR(run.Resume(&report.notes));
    LITAGS_RETURN_IF_ERROR(run.Train(cancel));
    observer->OnProgress(run.Saving());
    run.Finish(&report);
    report.seconds = Now() - start;
    LITAGS_RETURN_IF_ERROR(WriteFileAtomically(input.work_dir + "/report.json", report.ToJson()));
    return report;
  }

  absl::StatusOr<std::shared_ptr<const Scene>> LoadScene(const std::string& path) override {
    return LoadSceneFile(path);
  }

 private:
  std::string colmap_;
};

}  // namespace

std::unique_ptr<Engine> MakeEngine(std::string colmap) {
  return std::make_unique<RealEngine>(std::move(colmap));
}

}  // namespace litags
