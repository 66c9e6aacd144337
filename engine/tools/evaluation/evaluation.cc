#include "engine/tools/evaluation/evaluation.h"

#include <filesystem>
#include <nlohmann/json.hpp>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "engine/eval/metrics.h"
#include "engine/io/file_util.h"
#include "engine/io/image_io.h"

namespace litags {

namespace fs = std::filesystem;

std::string Scores::ToJson() const {
  nlohmann::json rows = nlohmann::json::array();
  for (const ViewScore& v : views) {
    rows.push_back({{"view", v.name}, {"psnr", v.psnr}, {"ssim", v.ssim}});
  }
  return nlohmann::json{
      {"views", rows}, {"psnr", psnr}, {"ssim", ssim}, {"psnr_affine", psnr_affine}}
      .dump(2, ' ', false, nlohmann::json::error_handler_t::replace);
}

absl::Status Scorer::Add(const std::string& name, const ImageU8& picture) {
  const std::string path = absl::StrCat(truth_dir_, "/", name);
  if (truth_dir_.empty() || !fs::exists(path)) return absl::OkStatus();
  LITAGS_ASSIGN_OR_RETURN(ImageU8 truth, ReadImage(path, absl::StrCat("truth[", name, "]")));
  if (truth.width != picture.width || truth.height != picture.height) {
    truth = ResizeArea(truth, picture.width, picture.height);
  }
  ViewScore score{.name = name};
  LITAGS_ASSIGN_OR_RETURN(score.psnr, Psnr(picture, truth));
  LITAGS_ASSIGN_OR_RETURN(score.ssim, Ssim(picture, truth));
  views_.push_back(std::move(score));
  pictures_.push_back(picture);
  truths_.push_back(std::move(truth));
  return absl::OkStatus();
}

absl::StatusOr<Scores> Scorer::Finish() const {
  if (views_.empty()) {
    return MakeError(absl::StatusCode::kNotFound, "NO_TRUTH", "truth",
                     absl::StrCat("truth: ", truth_dir_.empty() ? "no folder" : truth_dir_,
                                  " has no photo named as a test view"));
  }
  Scores scores;
  scores.views = views_;
  for (const ViewScore& v : views_) {
    scores.psnr += v.psnr / static_cast<double>(views_.size());
    scores.ssim += v.ssim / static_cast<double>(views_.size());
  }
  LITAGS_ASSIGN_OR_RETURN(const CorrectedPsnr fit, AffineCorrectedPsnr(pictures_, truths_));
  scores.psnr_affine = fit.corrected_db;
  return scores;
}

absl::StatusOr<Scores> ScoreScene(const Scene& scene, const std::vector<View>& views,
                                  const std::string& truth_dir, const std::string& pictures_dir,
                                  int threads) {
  std::error_code ignored;  // writing reports what matters
  if (!pictures_dir.empty()) fs::create_directories(pictures_dir, ignored);
  Scorer scorer(truth_dir);
  for (const View& view : views) {
    RenderRequest request;
    request.camera = view.camera;
    request.threads = threads;
    LITAGS_ASSIGN_OR_RETURN(const Planes color, scene.Render(request));
    const ImageU8 picture = ToImageU8(color);
    if (!pictures_dir.empty()) {
      LITAGS_RETURN_IF_ERROR(
          WritePng(absl::StrCat(pictures_dir, "/", Stem(view.name), ".png"), picture));
    }
    LITAGS_RETURN_IF_ERROR(scorer.Add(view.name, picture));
  }
  return scorer.Finish();
}

absl::StatusOr<Scores> ScorePhotos(const std::string& photos_dir, const std::vector<View>& views,
                                   const std::string& truth_dir,
                                   const ReconstructOptions& options) {
  Scorer scorer(truth_dir);
  for (const View& view : views) {
    const std::string path = absl::StrCat(photos_dir, "/", view.name);
    if (!fs::exists(path)) continue;
    LITAGS_ASSIGN_OR_RETURN(const ImageU8 photo,
                            ReadImage(path, absl::StrCat("images[", view.name, "]")));
    LITAGS_ASSIGN_OR_RETURN(const ImageU8 target, MakePseudoTarget(photo, options));
    LITAGS_RETURN_IF_ERROR(scorer.Add(view.name, target));
  }
  return scorer.Finish();
}

}  // namespace litags
