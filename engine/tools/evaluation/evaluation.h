// A trained scene against normally lit photos, as litags-train and litags-bench report it.
#ifndef LITAGS_ENGINE_TOOLS_EVALUATION_EVALUATION_H_
#define LITAGS_ENGINE_TOOLS_EVALUATION_EVALUATION_H_

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "engine/core/camera.h"
#include "engine/core/image.h"
#include "engine/pipeline/engine.h"

namespace litags {

struct ViewScore {
  std::string name;
  double psnr = 0;  // dB
  double ssim = 0;
};

struct Scores {
  std::vector<ViewScore> views;
  double psnr = 0, ssim = 0;  // means over views
  double psnr_affine = 0;     // mean PSNR after one colour fit for all views; a diagnostic
  std::string ToJson() const;
};

// Pictures of the same views as the truth photos TRUTH_DIR/<name>, which are resized to the
// picture where they differ. Views without a truth photo are left out; no views at all is
// NOT_FOUND.
class Scorer {
 public:
  explicit Scorer(std::string truth_dir) : truth_dir_(std::move(truth_dir)) {}
  absl::Status Add(const std::string& name, const ImageU8& picture);
  absl::StatusOr<Scores> Finish() const;

 private:
  std::string truth_dir_;
  std::vector<ViewScore> views_;
  std::vector<ImageU8> pictures_, truths_;
};

// Normal-lit renders of `views`, each also written to `pictures_dir`/<stem>.png unless that is
// empty.
absl::StatusOr<Scores> ScoreScene(const Scene& scene, const std::vector<View>& views,
                                  const std::string& truth_dir, const std::string& pictures_dir,
                                  int threads);

// What any method has to beat: the badly lit photos of the same views, each brightened by the
// tone rule that training uses.
absl::StatusOr<Scores> ScorePhotos(const std::string& photos_dir, const std::vector<View>& views,
                                   const std::string& truth_dir, const ReconstructOptions& options);

}  // namespace litags

#endif  // LITAGS_ENGINE_TOOLS_EVALUATION_EVALUATION_H_
