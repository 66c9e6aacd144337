#include "engine/sfm/colmap.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <utility>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "engine/core/parallel.h"
#include "engine/sfm/colmap_database.h"
#include "engine/sfm/photo_set.h"

namespace litags {
namespace {

// Pairs x limit^2 that may be compared. The limit is rough: COLMAP drops whole scale levels, so up
// to 1.7 times as many features come out, and 1.5e10 products, which take about 40 CPU seconds with
// AVX2.
constexpr double kMatchBudget = 5e9;
constexpr int kMinFeatures = 1000, kMaxFeatures = 4000;

// f and k1; the principal point stays at the image centre. Measured, see README.md.
constexpr char kCameraModel[] = "SIMPLE_RADIAL";

// Calls progress with the fraction of the first two numbers that `format` finds in a line.
std::function<void(std::string_view)> CountLines(const char* format, const FractionFn& progress) {
  return [format, &progress](std::string_view line) {
    int done = 0, total = 0;
    if (std::sscanf(std::string(line).c_str(), format, &done, &total) == 2 && total > 0) {
      progress(std::clamp(static_cast<double>(done) / total, 0.0, 1.0));
    }
  };
}

}  // namespace

int FeatureBudget(const SfmOptions& options, int num_photos) {
  if (options.max_features > 0) return options.max_features;
  const double pairs =
      static_cast<double>(std::max<size_t>(1, PairsToMatch(options, num_photos).size()));
  return static_cast<int>(
      std::clamp<double>(std::sqrt(kMatchBudget / pairs), kMinFeatures, kMaxFeatures));
}

Colmap::Colmap(const SfmOptions& options, std::string dir, const CancelToken& cancel)
    : options_(options),
      dir_(std::move(dir)),
      cancel_(cancel),
      threads_(options.threads > 0 ? options.threads : DefaultThreadCount()) {}

absl::Status Colmap::Failed(std::string_view reason, const std::string& command,
                            const std::string& how) const {
  return MakeError(
      absl::StatusCode::kInternal, reason, command,
      absl::StrCat("colmap ", command, " failed: ", how, " (log: ", dir_, "/", command, ".log)"));
}

absl::StatusOr<SubprocessResult> Colmap::Run(std::vector<std::string> args,
                                             const std::function<void(std::string_view)>& on_line) {
  const std::string command = args[0];
  SubprocessOptions child;
  child.args = std::move(args);
  child.args.insert(child.args.begin(), options_.colmap);
  child.args.insert(child.args.end(),
                    {"--random_seed", absl::StrCat(options_.seed), "--log_to_stderr", "1"});
  // No display and no thread pool larger than asked.
  const std::string threads = absl::StrCat(threads_);
  child.env = {"QT_QPA_PLATFORM=offscreen", "OMP_NUM_THREADS=" + threads,
               "OPENBLAS_NUM_THREADS=" + threads};
  child.log_path = absl::StrCat(dir_, "/", command, ".log");
  child.timeout_seconds = options_.step_timeout_seconds;
  child.on_line = on_line;

  auto result = RunSubprocess(child, cancel_);
  if (result.ok()) return result;
  const auto detail = GetErrorDetail(result.status());
  if (detail && detail->reason == "PROGRAM_NOT_FOUND") {
    return MakeError(absl::StatusCode::kFailedPrecondition, "COLMAP_NOT_FOUND", "colmap",
                     absl::StrCat("COLMAP \"", options_.colmap,
                                  "\" was not found; install it (apt-get install colmap), or bring "
                                  "known cameras with points"));
  }
  if (detail && detail->reason == "PROGRAM_KILLED") {
    return Failed("COLMAP_KILLED", command, std::string(result.status().message()));
  }
  if (detail && detail->reason == "PROGRAM_CRASHED") {
    return Failed("COLMAP_FAILED", command, std::string(result.status().message()));
  }
  return result;
}

absl::StatusOr<double> Colmap::RunChecked(std::vector<std::string> args,
                                          const std::function<void(std::string_view)>& on_line) {
  const std::string command = args[0];
  LITAGS_ASSIGN_OR_RETURN(const SubprocessResult result, Run(std::move(args), on_line));
  if (result.exit_code == 0) return result.seconds;
  return Failed("COLMAP_FAILED", command,
                absl::StrCat("exit code ", result.exit_code, ": ", result.tail));
}

absl::StatusOr<double> Colmap::ExtractFeatures(int num_photos, const FractionFn& progress) {
  std::vector<std::string> args = {"feature_extractor",
                                   "--database_path",
                                   database_path(),
                                   "--image_path",
                                   images_dir(),
                                   "--ImageReader.camera_model",
                                   kCameraModel,
                                   "--ImageReader.single_camera_per_folder",
                                   "1",
                                   "--SiftExtraction.use_gpu",
                                   "0",
                                   "--SiftExtraction.max_num_features",
                                   absl::StrCat(FeatureBudget(options_, num_photos)),
                                   "--SiftExtraction.num_threads",
                                   absl::StrCat(threads_)};
  // It takes photos without a mask as they are.
  if (!options_.masks.empty()) {
    args.insert(args.end(), {"--ImageReader.mask_path", masks_dir()});
  }
  return RunChecked(std::move(args), CountLines("Processed file [%d/%d]", progress));
}

absl::StatusOr<double> Colmap::Verify(const std::vector<NamePair>& pairs,
                                      const FractionFn& progress) {
  if (pairs.empty()) return 0;
  std::string list;
  for (const NamePair& pair : pairs) absl::StrAppend(&list, pair.name1, " ", pair.name2, "\n");
  const std::string list_path = dir_ + "/pairs.txt";
  LITAGS_RETURN_IF_ERROR(WriteScratch(list_path, list));
  // "pairs": for a pair with stored matches COLMAP only verifies, on all threads; "raw" would read
  // the matches as text and verify on one.
  return RunChecked(
      {"matches_importer", "--database_path", database_path(), "--match_list_path", list_path,
       "--match_type", "pairs", "--SiftMatching.use_gpu", "0", "--SiftMatching.num_threads",
       absl::StrCat(threads_), "--SiftMatching.min_num_inliers", absl::StrCat(kMinInliers)},
      CountLines("Matching block [%d/%d]", progress));
}

absl::StatusOr<double> Colmap::Map(const std::string& models_dir, int num_photos,
                                   const FractionFn& progress) {
  const auto on_line = [&](std::string_view line) {
    int image = 0, registered = 0;
    if (std::sscanf(std::string(line).c_str(), "Registering image #%d (%d)", &image, &registered) ==
        2) {
      progress(std::clamp(static_cast<double>(registered) / num_photos, 0.0, 1.0));
    }
  };
  LITAGS_ASSIGN_OR_RETURN(
      const SubprocessResult result,
      Run({"mapper", "--database_path", database_path(), "--image_path", images_dir(),
           "--output_path", models_dir, "--Mapper.num_threads", absl::StrCat(threads_),
           // Small groups tell the user about photos of different places; more tell nothing.
           "--Mapper.min_model_size", "3", "--Mapper.max_num_models", "10",
           "--Mapper.ba_refine_focal_length", "1", "--Mapper.ba_refine_principal_point", "0"},
          on_line));
  // COLMAP 3.8 ends with an error when no model came out: an answer, not a failure.
  if (result.exit_code != 0 && !absl::StrContains(result.tail, "failed to create sparse model")) {
    return Failed("COLMAP_FAILED", "mapper",
                  absl::StrCat("exit code ", result.exit_code, ": ", result.tail));
  }
  return result.seconds;
}

absl::StatusOr<double> Colmap::Triangulate(const std::string& input_dir,
                                           const std::string& output_dir, int num_photos,
                                           const FractionFn& progress) {
  int done = 0;
  bool nothing_to_adjust = false;
  const auto on_line = [&](std::string_view view) {
    const std::string line(view);
    if (absl::StrContains(line, "Triangulating image #")) {
      progress(std::min(1.0, static_cast<double>(++done) / num_photos));
    }
    if (absl::StrContains(line, "Check failed: bundle_adjuster.Solve")) nothing_to_adjust = true;
  };
  const auto start = std::chrono::steady_clock::now();
  const auto seconds =
      RunChecked({"point_triangulator", "--database_path", database_path(), "--image_path",
                  images_dir(), "--input_path", input_dir, "--output_path", output_dir,
                  "--Mapper.num_threads", absl::StrCat(threads_)},
                 on_line);
  // COLMAP 3.8 aborts where there is no point to adjust: an answer, not a failure.
  const auto detail = GetErrorDetail(seconds.status());
  if (nothing_to_adjust && detail && detail->reason == "COLMAP_FAILED") {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  }
  return seconds;
}

}  // namespace litags
