#include "engine/pipeline/engine.h"

#include <mutex>
#include <opencv2/core/utility.hpp>
#include <utility>

#include "engine/core/error.h"
#include "engine/core/monotonic_seconds.h"
#include "engine/core/parallel.h"
#include "engine/io/file_util.h"
#include "engine/pipeline/camera_source.h"
#include "engine/pipeline/context.h"
#include "engine/pipeline/depth_maps.h"
#include "engine/pipeline/exception_status.h"
#include "engine/pipeline/scene_file.h"
#include "engine/pipeline/train_set.h"
#include "engine/pipeline/training_run.h"
#include "engine/pipeline/video_frames.h"
#include "engine/pipeline/wide_views.h"
#include "engine/pipeline/work_folders.h"

namespace litags {
namespace {

class SilentObserver : public ReconstructObserver {
 public:
  void OnProgress(const Progress&) override {}
  void OnSnapshot(const std::string&) override {}
};

// OpenCV has a pool of its own, as large as the machine unless it is told.
class OpenCvThreads {
 public:
  explicit OpenCvThreads(int threads) {
    const std::lock_guard lock(mutex_);
    if (runs_++ == 0) before_ = cv::getNumThreads();
    cv::setNumThreads(threads);
  }
  ~OpenCvThreads() {
    const std::lock_guard lock(mutex_);
    if (--runs_ == 0) cv::setNumThreads(before_);
  }
  OpenCvThreads(const OpenCvThreads&) = delete;
  OpenCvThreads& operator=(const OpenCvThreads&) = delete;

 private:
  static inline std::mutex mutex_;
  static inline int runs_ = 0, before_ = 0;
};

class RealEngine : public Engine {
 public:
  explicit RealEngine(std::string colmap) : colmap_(std::move(colmap)) {}

  absl::StatusOr<ReconstructReport> Reconstruct(const ReconstructInput& given,
                                                const ReconstructOptions& options,
                                                const CancelToken& cancel,
                                                ReconstructObserver* observer) override {
    return WithoutExceptions([&] { return Run(given, options, cancel, observer); });
  }

  absl::StatusOr<std::shared_ptr<const Scene>> LoadScene(const std::string& path) override {
    return WithoutExceptions([&] { return LoadSceneFile(path); });
  }

 private:
  absl::StatusOr<ReconstructReport> Run(const ReconstructInput& given,
                                        const ReconstructOptions& options,
                                        const CancelToken& cancel,
                                        ReconstructObserver* observer) const {
    LITAGS_RETURN_IF_ERROR(options.Validate());
    SilentObserver silent;
    if (observer == nullptr) observer = &silent;
    const double start = MonotonicSeconds();
    LITAGS_RETURN_IF_ERROR(CheckWorkDir(given));
    LITAGS_ASSIGN_OR_RETURN(const FolderLock lock, LockWorkDir(given.work_dir));
    const OpenCvThreads opencv(options.threads > 0 ? options.threads : DefaultThreadCount());
    // Of a run that was killed while it wrote.
    RemoveStaleTempFiles(given.work_dir);
    RemoveStaleTempFiles(given.work_dir + "/cameras");
    RemoveStaleTempFiles(given.work_dir + "/found_masks");
    RemoveStaleTempFiles(SolvedFisheyes(given));
    ReconstructReport report;
    const auto progress = [&](Stage stage, const std::string& message) {
      Progress p;
      p.stage = stage;
      p.message = message;
      p.iterations = options.iterations;
      observer->OnProgress(p);
    };
    const auto loading = [&](const std::string& message) { progress(Stage::kLoading, message); };
    LITAGS_ASSIGN_OR_RETURN(
        const ReconstructInput photos,
        WithFramesAsPhotos(given, options.frames, cancel, loading, &report.notes));
    LITAGS_ASSIGN_OR_RETURN(
        const CutInput input,
        WithViewsOfWidePhotos(CutInput(photos), options.threads, cancel, loading, &report.notes));
    const Context context(input, options, cancel, progress, &report,
                          [observer](std::string_view line) { observer->OnLine(line); });
    LITAGS_RETURN_IF_ERROR(CheckDepthSource(context));
    LITAGS_ASSIGN_OR_RETURN(const TrainSet set, MakeTrainSet(context, colmap_));
    LITAGS_ASSIGN_OR_RETURN(const std::unique_ptr<TrainingRun> run,
                            TrainingRun::Start(context, set, observer));
    LITAGS_RETURN_IF_ERROR(run->Train());
    run->Finish();
    report.seconds = MonotonicSeconds() - start;
    LITAGS_RETURN_IF_ERROR(WriteFileAtomically(input.work_dir + "/report.json", report.ToJson()));
    return report;
  }

  std::string colmap_;
};

}  // namespace

std::unique_ptr<Engine> MakeEngine(std::string colmap) {
  return std::make_unique<RealEngine>(std::move(colmap));
}

}  // namespace litags
