// What a reconstruction tells while it runs and at its end.
#ifndef LITAGS_ENGINE_PIPELINE_REPORT_H_
#define LITAGS_ENGINE_PIPELINE_REPORT_H_

#include <cstdint>
#include <limits>
#include <map>
#include <string>
#include <string_view>
#include <vector>

namespace litags {

enum class Stage { kLoading, kFindingCameras, kPreparing, kTraining, kSaving };
std::string_view StageName(Stage stage);  // "loading", "finding-cameras", ...

inline constexpr double kNotMeasured = std::numeric_limits<double>::quiet_NaN();

// px. Clients of a service get previews in messages of 4 MiB at most.
inline constexpr int kMaxPreviewSide = 800;

// One report of progress. Numbers not known yet are 0.
struct Progress {
  Stage stage = Stage::kLoading;
  std::string message;  // for a human; may be empty
  int iteration = 0;
  int iterations = 0;  // total
  double loss = 0;     // running mean of the total loss
  double loss_exposure = 0, loss_reconstruction = 0, loss_structure = 0, loss_denoise = 0;
  // dB against the pseudo-target on held-out views, where they count.
  double psnr_holdout = kNotMeasured;
  int64_t gaussians = 0;
  double iterations_per_second = 0;
  double eta_seconds = 0;
  std::vector<uint8_t> preview_png;  // often empty; no side is above kMaxPreviewSide
};

// Called from the training thread; must return quickly. A new snapshot is announced after its
// file was atomically replaced.
class ReconstructObserver {
 public:
  virtual ~ReconstructObserver() = default;
  virtual void OnProgress(const Progress& progress) = 0;
  virtual void OnSnapshot(const std::string& scene_path) = 0;
  // A line that a program which the engine runs (COLMAP) wrote. Called by any thread.
  virtual void OnLine(std::string_view) {}
};

struct ReconstructReport {
  int photos = 0;
  int registered = 0;
  std::vector<std::string> dropped;  // photos without a camera, by name
  std::string sfm_preparation;       // rung of the exposure ladder that won; "given" if known
  int64_t sparse_points = 0;
  int64_t gaussians = 0;
  int iterations = 0;
  // Those before it are of earlier runs, which left a checkpoint. All seconds are of the run that
  // finished.
  int first_iteration = 0;
  double seconds = 0;           // from the first photo to the report
  double training_seconds = 0;  // of them in iterations
  // Of finding cameras, all preparations together: "prepare", "features", "match", "verify", "map".
  // Empty where they were not searched for.
  std::map<std::string, double> camera_seconds;
  // Where training_seconds went: "forward", "losses", "denoise", "backward", "density".
  std::map<std::string, double> phase_seconds;
  double psnr_holdout = kNotMeasured;  // as in Progress
  double ssim_holdout = kNotMeasured;  // of the same, at the end
  bool depth_used = false;
  std::vector<std::string> notes;  // what the user should know: "photo.jpg is left out: ..."
  std::string scene_path;          // work_dir/scene.litags
  std::string ToJson() const;
};

}  // namespace litags

#endif  // LITAGS_ENGINE_PIPELINE_REPORT_H_
