// litags-bench train: one training run on a benchmark scene, with where its time and memory went.
#include <cstdio>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "CLI/App.hpp"
#include "CLI/Config.hpp"
#include "CLI/Formatter.hpp"
#include "absl/algorithm/container.h"
#include "absl/status/status.h"
#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "engine/core/json_text.h"
#include "engine/io/image_io.h"
#include "engine/pipeline/work_folders.h"
#include "engine/tools/bench/command_options.h"
#include "engine/tools/bench/commands.h"
#include "engine/tools/bench/timing.h"
#include "engine/tools/evaluation/benchmark_scene.h"
#include "engine/tools/evaluation/evaluation.h"
#include "engine/tools/evaluation/method_options.h"
#include "engine/tools/evaluation/process_usage.h"
#include "engine/tools/evaluation/progress_lines.h"
#include "engine/tools/inspect/dataset_folder.h"
#include "proto/arguments/arguments.h"

namespace litags {
namespace {

struct TrainArguments {
  BenchmarkScene scene;
  ReconstructOptions options;
  std::vector<std::string> set;  // constants of the recipe
  int evaluate_every = 0;
  std::string out, json;
  std::vector<std::string> score_also;  // folders of the truth at other sizes
};

// Scores the snapshots as they come. The time this takes is kept apart.
class Recorder : public ReconstructObserver {
 public:
  Recorder(const TrainArguments& args, Engine* engine) : args_(args), engine_(engine) {}

  void OnProgress(const Progress& p) override {
    lines_.OnProgress(p);
    if (p.stage == Stage::kTraining && first_ms_ == 0) first_ms_ = NowMs();
    iteration_ = p.iteration;
    gaussians_ = p.gaussians;
  }
  void OnSnapshot(const std::string& path) override {
    if (args_.evaluate_every == 0) return;
    const double start = NowMs();
    if (absl::Status s = Score(path); !s.ok() && status.ok()) status = s;
    paused_ms_ += NowMs() - start;
  }

  nlohmann::json history = nlohmann::json::array();
  absl::Status status;

 private:
  absl::Status Score(const std::string& path) {
    const double seconds = (NowMs() - first_ms_ - paused_ms_) / 1e3;
    LITAGS_ASSIGN_OR_RETURN(const std::shared_ptr<const Scene> scene, engine_->LoadScene(path));
    LITAGS_ASSIGN_OR_RETURN(const std::vector<TestView> views, args_.scene.TestViews());
    LITAGS_ASSIGN_OR_RETURN(const Scores scores,
                            ScoreScene(*scene, AtMost(args_.options.max_image_side, views),
                                       args_.scene.TruthDir(), "", args_.options.threads));
    history.push_back({{"iteration", iteration_},
                       {"seconds", seconds},
                       {"gaussians", gaussians_},
                       {"psnr", scores.psnr},
                       {"ssim", scores.ssim},
                       {"psnr_affine", scores.psnr_affine}});
    std::printf("iteration %5d  %7.1f s  %7d Gaussians  PSNR %.2f dB  SSIM %.4f\n", iteration_,
                seconds, static_cast<int>(gaussians_), scores.psnr, scores.ssim);
    std::fflush(stdout);
    return absl::OkStatus();
  }

  const TrainArguments& args_;
  Engine* engine_;
  ProgressLines lines_;
  int iteration_ = 0;
  int64_t gaussians_ = 0;
  double first_ms_ = 0, paused_ms_ = 0;
};

nlohmann::json JsonOf(const Scores& scores) {
  return {{"psnr", scores.psnr}, {"ssim", scores.ssim}, {"psnr_affine", scores.psnr_affine}};
}

// Pictures of the sizes that the photos in args.score_also have.
absl::StatusOr<nlohmann::json> ScoreAlso(const TrainArguments& args, const Scene& scene,
                                         const std::vector<TestView>& views) {
  nlohmann::json rows = nlohmann::json::array();
  for (const std::string& dir : args.score_also) {
    LITAGS_ASSIGN_OR_RETURN(const std::vector<TestView> sized, AtSizeOfPhotos(views, dir));
    LITAGS_ASSIGN_OR_RETURN(const Scores scores,
                            ScoreScene(scene, sized, dir, "", args.options.threads));
    const Camera& camera = sized.front().view.camera;
    std::printf("%dx%d, %s: PSNR %.2f dB  SSIM %.4f  (after one colour fit %.2f dB)\n",
                camera.width, camera.height, dir.c_str(), scores.psnr, scores.ssim,
                scores.psnr_affine);
    rows.push_back(JsonOf(scores));
    rows.back()["size"] = {camera.width, camera.height};
  }
  return rows;
}

// Prints where the time and memory of a run went.
nlohmann::json ReportSpeed(const ReconstructReport& report, int64_t peak_bytes) {
  const double seconds = report.training_seconds;
  std::printf("%d iterations in %.1f s (%.1f it/s), %d Gaussians, peak %.0f MiB\n",
              report.iterations, seconds, report.iterations / seconds,
              static_cast<int>(report.gaussians), peak_bytes / 1048576.0);
  for (const auto& [phase, spent] : report.phase_seconds) {
    std::printf("  %-9s %7.2f ms an iteration  %4.1f %%\n", phase.c_str(),
                1e3 * spent / report.iterations, 100 * spent / seconds);
  }
  return {{"iterations", report.iterations},
          {"seconds", seconds},
          {"iterations_per_second", report.iterations / seconds},
          {"peak_rss_bytes", peak_bytes},
          {"gaussians", report.gaussians},
          {"phase_seconds", report.phase_seconds}};
}

// Prints how far the depth is from the truth.
nlohmann::json ReportDepth(const DepthScores& depth) {
  std::printf("depth: %.1f %% within 2 %%, %.1f %% within 10 %%, %.1f %% more than 20 %% too far\n",
              100 * depth.within_2_percent, 100 * depth.within_10_percent,
              100 * depth.beyond_20_percent);
  return {{"within_2_percent", depth.within_2_percent},
          {"within_10_percent", depth.within_10_percent},
          {"beyond_20_percent", depth.beyond_20_percent}};
}

// So that nothing that an earlier run kept is used: the seconds are those of the whole run.
absl::Status RemoveOldRun(const ReconstructInput& input) {
  const std::string& out = input.work_dir;
  LITAGS_RETURN_IF_ERROR(CheckWorkDir(input));
  std::error_code ignored;  // writing reports what matters
  std::filesystem::create_directories(out, ignored);
  LITAGS_ASSIGN_OR_RETURN(const FolderLock lock, LockWorkDir(out));
  for (const char* old :
       {"/scene.litags", "/checkpoint.litags", "/depth.litags", "/start.litags", "/cameras"}) {
    std::filesystem::remove_all(out + old, ignored);
  }
  return absl::OkStatus();
}

// Before anything is trained: what the scene is scored against is there and fits.
absl::Status CheckTruth(const TrainArguments& args, const std::vector<TestView>& views) {
  const std::string truth = args.scene.TruthDir();
  const auto has_truth = [&](const TestView& view) {
    return FindPhoto(truth, view.view.name).ok();
  };
  if (absl::c_none_of(views, has_truth)) return Scorer(truth).Finish().status();
  for (const std::string& dir : args.score_also) {
    LITAGS_RETURN_IF_ERROR(AtSizeOfPhotos(views, dir).status());
  }
  return CheckTrueDepth(AtMost(args.options.max_image_side, views), args.scene.DepthDir());
}

absl::Status Train(TrainArguments args) {
  LITAGS_RETURN_IF_ERROR(SetConstants(args.set, &args.options));
  if (args.scene.TruthDir().empty()) {
    return MakeError(
        absl::StatusCode::kNotFound, "NO_TRUTH", "scene",
        absl::StrCat(args.scene.dir, " has no folder high of photos to score against; ",
                     "litags-train renders such scenes"));
  }
  if (!args.scene.HasTestViews()) {
    return MakeError(absl::StatusCode::kNotFound, "NO_SUCH_SCENE", "scene",
                     absl::StrCat(args.scene.dir, " has no transforms_test.json, and so no test ",
                                  "views to score; litags-train trains on such scenes"));
  }
  LITAGS_RETURN_IF_ERROR(ListPhotos(args.scene.PhotosDir(), "--light").status());
  LITAGS_ASSIGN_OR_RETURN(ReconstructInput input, args.scene.Input(args.out, &args.options));
  UseMasksBeside(input.images_dir, &input.masks_dir);
  args.options.preview_every =
      args.evaluate_every > 0 ? args.evaluate_every : args.options.iterations;
  args.options.checkpoint_every = args.options.iterations;
  LITAGS_RETURN_IF_ERROR(args.options.Validate());
  LITAGS_ASSIGN_OR_RETURN(const std::vector<TestView> views, args.scene.TestViews());
  LITAGS_RETURN_IF_ERROR(CheckTruth(args, views));
  LITAGS_RETURN_IF_ERROR(RemoveOldRun(input));

  const std::unique_ptr<Engine> engine = MakeEngine();
  Recorder recorder(args, engine.get());
  LITAGS_ASSIGN_OR_RETURN(const ReconstructReport report,
                          engine->Reconstruct(input, args.options, CancelToken(), &recorder));
  LITAGS_RETURN_IF_ERROR(recorder.status);
  const int64_t peak = PeakRssBytes();
  LITAGS_ASSIGN_OR_RETURN(const std::shared_ptr<const Scene> scene,
                          engine->LoadScene(report.scene_path));
  const std::vector<TestView> trained = AtMost(args.options.max_image_side, views);
  LITAGS_ASSIGN_OR_RETURN(const Scores scores, ScoreScene(*scene, trained, args.scene.TruthDir(),
                                                          "", args.options.threads));
  LITAGS_ASSIGN_OR_RETURN(const std::optional<DepthScores> depth,
                          ScoreDepth(*scene, trained, args.scene.DepthDir(), args.options.threads));

  nlohmann::json json = ReportSpeed(report, peak);
  json["history"] = recorder.history;
  std::printf("test views: PSNR %.2f dB  SSIM %.4f  (after one colour fit %.2f dB)\n", scores.psnr,
              scores.ssim, scores.psnr_affine);
  json.update(JsonOf(scores));
  LITAGS_ASSIGN_OR_RETURN(json["other_sizes"], ScoreAlso(args, *scene, views));
  if (depth.has_value()) json["depth"] = ReportDepth(*depth);
  return WriteJson(args.json, JsonText(json, 2));
}

}  // namespace

void AddTrainCommand(CLI::App* app, int* exit_status) {
  auto args = std::make_shared<TrainArguments>();
  CLI::App* command =
      app->add_subcommand("train", "Trains on a benchmark scene and measures time and quality");
  AddSceneOptions(command, "SCENE with low/, high/, transforms_train.json", &args->scene);
  command->add_option("--cameras", args->scene.cameras,
                      "transforms.json or COLMAP model instead of transforms_train.json");
  AddOutputOption(command, "folder for the scene", &args->out);
  command
      ->add_option("--evaluate-every", args->evaluate_every,
                   "also score the test views every so many iterations; 0: only at the end")
      ->check(Between(0, 1000000));
  command
      ->add_option("--score-also", args->score_also,
                   "folder of photos named as high/'s, but of another size: what pictures of that "
                   "size are like")
      ->check(CLI::ExistingDirectory);
  AddJsonOption(command, &args->json);
  // --evaluate-every says when it looks, no run goes on from a checkpoint, and nothing but the test
  // views is held out.
  AddMethodOptions(command, &args->options, &args->set,
                   {"preview_every", "checkpoint_every", "frames", "holdout_every"});
  RefuseGivenDepth(command);
  WhenGiven(command, exit_status, [args] { return Train(*args); });
}

}  // namespace litags
