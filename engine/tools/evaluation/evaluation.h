// A trained scene against normally lit photos, as litags-train and litags-bench report it.
#ifndef LITAGS_ENGINE_TOOLS_EVALUATION_EVALUATION_H_
#define LITAGS_ENGINE_TOOLS_EVALUATION_EVALUATION_H_

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "absl/status/statusor.h"
#include "engine/core/image.h"
#include "engine/eval/lpips.h"
#include "engine/pipeline/options.h"
#include "engine/pipeline/scene.h"
#include "engine/tools/evaluation/test_view.h"

namespace litags {

struct ViewScore {
  std::string name;
  double psnr = 0;              // dB
  double ssim = 0;              // NaN of pictures with a side below 11 px, its window
  std::optional<double> lpips;  // where there is a network for it
};

struct Scores {
  std::vector<ViewScore> views;
  double psnr = 0, ssim = 0;  // means over views; ssim over those that have it, NaN without any
  std::optional<double> lpips;
  double psnr_affine = 0;  // mean PSNR after one colour fit for all views; a diagnostic
  std::string ToJson() const;
};

// Pictures of the same views as the truth photos TRUTH_DIR/<name>, which are resized to the
// picture (in linear light) where they differ, and undistorted. Views without a truth photo are
// left out; no views at all is NOT_FOUND. `lpips` may be null.
class Scorer {
 public:
  explicit Scorer(std::string truth_dir, Lpips* lpips = nullptr)
      : truth_dir_(std::move(truth_dir)), lpips_(lpips) {}
  absl::Status Add(const TestView& view, const ImageU8& picture);
  absl::StatusOr<Scores> Finish() const;

 private:
  std::string truth_dir_;
  Lpips* lpips_;
  std::vector<ViewScore> views_;
  std::vector<ImageU8> pictures_, truths_;
  std::vector<PlaneU8> shown_;  // masks: which pixels the truth photo shows
};

// The normal-lit render of a view, as bytes.
absl::StatusOr<ImageU8> RenderPicture(const Scene& scene, const View& view, int threads);

// What pictures of photos are called, without their ending: <stem>, or <name> where another photo
// has the stem, too.
std::vector<std::string> PictureStems(const std::vector<std::string>& names);

// Normal-lit renders of the scene's own cameras at the size that it was trained at:
// `dir`/<PictureStems>.png.
absl::Status WriteViews(const Scene& scene, const std::string& dir, int threads);

// Normal-lit renders of `views`, each also written to `pictures_dir`/<PictureStems>.png unless that
// is empty.
absl::StatusOr<Scores> ScoreScene(const Scene& scene, const std::vector<TestView>& views,
                                  const std::string& truth_dir, const std::string& pictures_dir,
                                  int threads);

// Depth of the normal-lit renders against the truth, over the pixels that have one: shares of them,
// means over views.
struct DepthScores {
  int views = 0;
  double within_2_percent = 0, within_10_percent = 0;
  double beyond_20_percent = 0;  // too far by more: holes
};

// What ScoreDepth would refuse of the truth, before there is a scene.
absl::Status CheckTrueDepth(const std::vector<TestView>& views, const std::string& depth_dir);

// Truth: `depth_dir`/<stem>.{png,pfm,npy} of the pictures' size, distance along the axis in the
// cameras' units, 0: none. Views without it are left out, and those whose photos are distorted. No
// views at all is nullopt.
absl::StatusOr<std::optional<DepthScores>> ScoreDepth(const Scene& scene,
                                                      const std::vector<TestView>& views,
                                                      const std::string& depth_dir, int threads);

// What any method has to beat: the badly lit photos of the same views, each brightened by the
// tone rule that training uses. Black ones cannot be (IsBlack): they are left out, and added to
// `black` by name.
absl::StatusOr<Scores> ScorePhotos(const std::string& photos_dir,
                                   const std::vector<TestView>& views, const std::string& truth_dir,
                                   const ReconstructOptions& options,
                                   std::vector<std::string>* black);

}  // namespace litags

#endif  // LITAGS_ENGINE_TOOLS_EVALUATION_EVALUATION_H_
