#include "engine/sfm/colmap.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <iterator>
#include <utility>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "engine/core/error.h"
#include "engine/core/monotonic_seconds.h"
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

// SIFT looks for its smallest features in a photo of doubled size, which is four fifths of its
// time, and COLMAP drops them first where there are more features than its budget. So large photos
// go without, and those that miss their budget then go again with them. A photo full of texture has
// a feature per 260 px without; one of fewer pixels than this many per feature goes with them at
// once.
constexpr double kPixelsPerFeature = 200;

// For more than match_all_up_to photos: as many features together as 200 photos have, because the
// mapper's time grows with them. A photo of 500 still has several times the 100 inliers that the
// mapper asks of its first pair. Choice.
constexpr double kCaptureFeatures = 200 * 1000, kMinFeaturesOfMany = 500;

// f and k1; the principal point stays at the image centre. Measured: docs/experiments/cameras.md.
constexpr char kCameraModel[] = "SIMPLE_RADIAL";

// COLMAP's random numbers are drawn by each thread for whatever work it gets, and Ceres adds up in
// the order of threads. So one thread does a share of the verification, which is cut by the pairs
// alone, and one thread maps.
constexpr size_t kPairsPerShare = 40, kMaxShares = 16;

// No display, and one thread for sums of matrices. Memory starts as zeros: VLFeat describes no
// feature in the last row of an image, and COLMAP 3.8 then stores what the memory held before.
// (tcache hands out memory as it is, whatever perturb says.)
constexpr const char* kEnvironment[] = {
    "QT_QPA_PLATFORM=offscreen", "OMP_NUM_THREADS=1", "OPENBLAS_NUM_THREADS=1",
    "GLIBC_TUNABLES=glibc.malloc.tcache_count=0:glibc.malloc.perturb=255"};

// Bundle adjustment of large captures: of all cameras when the model has grown by a half, not by a
// tenth, and one round of half as many iterations each. Only the last adjustment sets the result.
// Almost five times as fast and as accurate: docs/experiments/cameras.md.
constexpr const char* kFewAdjustments[] = {
    "--Mapper.ba_global_images_ratio",       "1.5", "--Mapper.ba_global_points_ratio",      "1.5",
    "--Mapper.ba_global_max_refinements",    "1",   "--Mapper.ba_local_max_refinements",    "1",
    "--Mapper.ba_global_max_num_iterations", "25",  "--Mapper.ba_local_max_num_iterations", "12",
    "--Mapper.ba_global_function_tolerance", "1e-6"};

absl::Status CopyScratch(const std::string& from, const std::string& to) {
  std::error_code error;
  std::filesystem::copy_file(from, to, std::filesystem::copy_options::overwrite_existing, error);
  if (!error) return absl::OkStatus();
  return MakeError(absl::StatusCode::kResourceExhausted, "DISK_FULL", "work_dir",
                   absl::StrCat("cannot copy to \"", to, "\": ", error.message(),
                                "; free some room on the disk"));
}

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
  if (num_photos > options.match_all_up_to) {
    return static_cast<int>(
        std::clamp(kCaptureFeatures / num_photos, kMinFeaturesOfMany, double{kMinFeatures}));
  }
  const double pairs = std::max(1.0, 0.5 * num_photos * (num_photos - 1));
  return static_cast<int>(
      std::clamp<double>(std::sqrt(kMatchBudget / pairs), kMinFeatures, kMaxFeatures));
}

Colmap::Colmap(const SfmOptions& options, std::string dir, const CancelToken& cancel)
    : options_(options),
      dir_(std::move(dir)),
      cancel_(cancel),
      threads_(options.threads > 0 ? options.threads : DefaultThreadCount()) {}

absl::Status Colmap::Failed(std::string_view reason, const std::string& command,
                            const std::string& log_name, const std::string& how) const {
  return MakeError(
      absl::StatusCode::kInternal, reason, command,
      absl::StrCat("colmap ", command, " failed: ", how, " (log: ", dir_, "/", log_name, ".log)"));
}

absl::StatusOr<SubprocessResult> Colmap::Run(std::vector<std::string> args,
                                             const std::string& log_name, const OnLine& on_line) {
  const std::string command = args[0];
  SubprocessOptions child;
  child.args = std::move(args);
  child.args.insert(child.args.begin(), options_.colmap);
  child.args.insert(child.args.end(),
                    {"--random_seed", absl::StrCat(options_.seed), "--log_to_stderr", "1"});
  child.env.assign(std::begin(kEnvironment), std::end(kEnvironment));
  child.env.push_back("TMPDIR=" + dir_);  // of its databases
  child.confined = true;
  child.files.change = {dir_};
  child.log_path = absl::StrCat(dir_, "/", log_name, ".log");
  child.timeout_seconds = options_.step_timeout_seconds;
  child.on_line = [this, &on_line](std::string_view line) {
    if (options_.on_line) options_.on_line(line);
    if (on_line) on_line(line);
  };

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
    return Failed("COLMAP_KILLED", command, log_name, std::string(result.status().message()));
  }
  if (detail && detail->reason == "PROGRAM_CRASHED") {
    return Failed("COLMAP_FAILED", command, log_name, std::string(result.status().message()));
  }
  return result;
}

absl::StatusOr<double> Colmap::RunChecked(std::vector<std::string> args,
                                          const std::string& log_name, const OnLine& on_line) {
  const std::string command = args[0];
  LITAGS_ASSIGN_OR_RETURN(const SubprocessResult result, Run(std::move(args), log_name, on_line));
  if (result.exit_code == 0) return result.seconds;
  return Failed("COLMAP_FAILED", command, log_name,
                absl::StrCat("exit code ", result.exit_code, ": ", result.tail));
}

absl::StatusOr<double> Colmap::ExtractPass(const std::vector<std::string>& copies, int budget,
                                           int first_octave, const std::string& log_name,
                                           const FractionFn& progress) {
  const std::string list = dir_ + "/" + log_name + ".txt";
  LITAGS_RETURN_IF_ERROR(WriteScratch(list, absl::StrJoin(copies, "\n") + "\n"));
  std::vector<std::string> args = {"feature_extractor",
                                   "--database_path",
                                   database_path(),
                                   "--image_path",
                                   images_dir(),
                                   "--image_list_path",
                                   list,
                                   "--ImageReader.camera_model",
                                   kCameraModel,
                                   "--ImageReader.single_camera_per_folder",
                                   "1",
                                   "--SiftExtraction.use_gpu",
                                   "0",
                                   "--SiftExtraction.first_octave",
                                   absl::StrCat(first_octave),
                                   "--SiftExtraction.max_num_features",
                                   absl::StrCat(budget),
                                   "--SiftExtraction.num_threads",
                                   absl::StrCat(threads_)};
  // It takes photos without a mask as they are.
  if (!options_.masks.empty()) {
    args.insert(args.end(), {"--ImageReader.mask_path", masks_dir()});
  }
  return RunChecked(std::move(args), log_name, CountLines("Processed file [%d/%d]", progress));
}

absl::StatusOr<double> Colmap::ExtractFeatures(const std::vector<PhotoFile>& photos,
                                               const FractionFn& progress) {
  const int budget = FeatureBudget(options_, static_cast<int>(photos.size()));
  std::vector<std::string> large, doubled;
  for (const PhotoFile& photo : photos) {
    const double pixels = static_cast<double>(photo.copy_width) * photo.copy_height;
    (pixels > kPixelsPerFeature * budget ? large : doubled).push_back(photo.copy_name);
  }
  const double share = static_cast<double>(large.size()) / photos.size();
  double seconds = 0;
  if (!large.empty()) {
    LITAGS_ASSIGN_OR_RETURN(seconds, ExtractPass(large, budget, 0, "feature_extractor",
                                                 [&](double f) { progress(share * f); }));
    LITAGS_ASSIGN_OR_RETURN(const std::vector<std::string> few,
                            TakeFewFeaturesOut(database_path(), budget));
    doubled.insert(doubled.end(), few.begin(), few.end());
  }
  if (doubled.empty()) return seconds;
  std::sort(doubled.begin(), doubled.end());
  LITAGS_ASSIGN_OR_RETURN(
      const double more,
      ExtractPass(doubled, budget, -1, large.empty() ? "feature_extractor" : "feature_extractor_2",
                  [&](double f) { progress(share + (1 - share) * f); }));
  return seconds + more;
}

absl::Status Colmap::VerifyShare(const std::string& database, absl::Span<const NamePair> pairs,
                                 const std::string& log_name) {
  std::string list;
  for (const NamePair& pair : pairs) absl::StrAppend(&list, pair.name1, " ", pair.name2, "\n");
  const std::string list_path = database + ".pairs.txt";
  LITAGS_RETURN_IF_ERROR(WriteScratch(list_path, list));
  // "pairs": for a pair with stored matches COLMAP only verifies; "raw" would read the matches as
  // text.
  return RunChecked({"matches_importer", "--database_path", database, "--match_list_path",
                     list_path, "--match_type", "pairs", "--SiftMatching.use_gpu", "0",
                     "--SiftMatching.num_threads", "1"},
                    log_name, nullptr)
      .status();
}

absl::StatusOr<double> Colmap::Verify(const std::vector<NamePair>& pairs,
                                      const FractionFn& progress) {
  if (pairs.empty()) return 0;
  const double start = MonotonicSeconds();
  const size_t shares = std::clamp<size_t>(pairs.size() / kPairsPerShare, 1, kMaxShares);
  const std::string common = dir_ + "/verify.db";
  LITAGS_RETURN_IF_ERROR(CopyForVerification(database_path(), common));
  std::vector<std::string> databases;
  for (size_t i = 0; i < shares; ++i) databases.push_back(absl::StrCat(dir_, "/verify_", i, ".db"));
  std::vector<absl::Status> statuses(shares);
  std::atomic<size_t> done = 0;
  ParallelFor(threads_, shares, [&](size_t i, int thread) {
    const size_t begin = i * pairs.size() / shares, end = (i + 1) * pairs.size() / shares;
    statuses[i] = CopyScratch(common, databases[i]);
    if (!statuses[i].ok()) return;
    statuses[i] = VerifyShare(databases[i], absl::MakeConstSpan(&pairs[begin], end - begin),
                              absl::StrCat("matches_importer_", i));
    ++done;
    if (thread == 0) progress(static_cast<double>(done) / shares);
  });
  for (absl::Status& status : statuses) LITAGS_RETURN_IF_ERROR(std::move(status));
  LITAGS_RETURN_IF_ERROR(TakeVerifiedPairs(databases, database_path()));
  return MonotonicSeconds() - start;
}

absl::StatusOr<double> Colmap::Map(const std::string& models_dir,
                                   const std::vector<PhotoFile>& photos,
                                   const FractionFn& progress) {
  const int num_photos = static_cast<int>(photos.size());
  const bool known = std::all_of(photos.begin(), photos.end(), [](const PhotoFile& photo) {
    return photo.copy_focal_length > 0;
  });
  const char* const refine = known ? "0" : "1";
  const auto on_line = [&](std::string_view line) {
    int image = 0, registered = 0;
    if (std::sscanf(std::string(line).c_str(), "Registering image #%d (%d)", &image, &registered) ==
        2) {
      progress(std::clamp(static_cast<double>(registered) / num_photos, 0.0, 1.0));
    }
  };
  std::vector<std::string> args = {
      "mapper", "--database_path", database_path(), "--image_path", images_dir(), "--output_path",
      models_dir, "--Mapper.num_threads", "1",
      // Small groups tell the user about photos of different places; more tell nothing.
      "--Mapper.min_model_size", "3", "--Mapper.max_num_models", "10",
      "--Mapper.ba_refine_focal_length", refine, "--Mapper.ba_refine_extra_params", refine,
      "--Mapper.ba_refine_principal_point", "0"};
  if (num_photos > options_.match_all_up_to) {
    args.insert(args.end(), std::begin(kFewAdjustments), std::end(kFewAdjustments));
  }
  LITAGS_ASSIGN_OR_RETURN(const SubprocessResult result, Run(std::move(args), "mapper", on_line));
  // COLMAP 3.8 ends with an error when no model came out: an answer, not a failure.
  if (result.exit_code != 0 && !absl::StrContains(result.tail, "failed to create sparse model")) {
    return Failed("COLMAP_FAILED", "mapper", "mapper",
                  absl::StrCat("exit code ", result.exit_code, ": ", result.tail));
  }
  return result.seconds;
}

}  // namespace litags
