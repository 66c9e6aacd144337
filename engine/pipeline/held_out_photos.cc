#include "engine/pipeline/held_out_photos.h"

#include <algorithm>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "engine/core/error.h"
#include "engine/eval/metrics.h"
#include "engine/train/fit_camera.h"
#include "engine/train/losses.h"

namespace litags {
namespace {

constexpr size_t kScoredOfPreview = 16;

}  // namespace

HeldOutPhotos::HeldOutPhotos(const std::vector<TrainView>* photos, int threads)
    : photos_(*photos), threads_(threads) {
  for (const TrainView& photo : photos_) views_.push_back(photo.view);
}

absl::StatusOr<HeldOutScores> HeldOutPhotos::ScoreSome(ModelRenderer& renderer, const Model& model,
                                                       const CancelToken& cancel) const {
  return Score(std::min(photos_.size(), kScoredOfPreview), false, renderer, model, cancel);
}

absl::StatusOr<HeldOutScores> HeldOutPhotos::ScoreAll(ModelRenderer& renderer, const Model& model,
                                                      const CancelToken& cancel) const {
  return Score(photos_.size(), true, renderer, model, cancel);
}

absl::StatusOr<HeldOutScores> HeldOutPhotos::Score(size_t count, bool with_ssim,
                                                   ModelRenderer& renderer, const Model& model,
                                                   const CancelToken& cancel) const {
  if (count == 0) return HeldOutScores();
  LossWorkspace workspace(threads_);
  Planes color, target;
  double psnr_sum = 0, ssim_sum = 0;
  int with_windows = 0;
  for (size_t k = 0; k < count; ++k) {
    if (cancel.IsCancelled()) return cancel.Check();
    const size_t i = k * photos_.size() / count;
    const TrainView& photo = photos_[i];
    renderer.RenderColor(model, views_[i].camera, &color, photo.lamp);
    for (float& x : color.data) x = std::clamp(x, 0.0f, 1.0f);
    UnpackImage(photo.target, workspace, &target);
    LITAGS_ASSIGN_OR_RETURN(const double psnr, Psnr(color, target, photo.mask));
    psnr_sum += psnr;
    if (!with_ssim) continue;
    const auto ssim = Ssim(color, target, SsimBorder::kValid, threads_, photo.mask);
    if (!ssim.ok()) continue;  // no window of it counts
    ssim_sum += *ssim;
    ++with_windows;
  }
  return HeldOutScores{psnr_sum / static_cast<double>(count),
                       with_windows > 0 ? ssim_sum / with_windows : kNotMeasured};
}

absl::Status HeldOutPhotos::FitCameras(const TrainOptions& options, const Model& model,
                                       double extent,
                                       const std::function<void(size_t placed)>& on_photo,
                                       const CancelToken& cancel, std::vector<std::string>* notes) {
  std::vector<std::string> not_finite;
  for (size_t i = 0; i < photos_.size(); ++i) {
    on_photo(i);
    LITAGS_ASSIGN_OR_RETURN(const FittedCamera fitted,
                            FitCamera(options, model, photos_[i], extent, cancel));
    views_[i].camera = fitted.camera;
    if (!fitted.finite) not_finite.push_back(views_[i].name);
  }
  if (!not_finite.empty()) {
    notes->push_back(absl::StrCat(
        "held-out photos that are not placed to the end, because a number was not finite: ",
        absl::StrJoin(not_finite, ", "), "; their scores tell less"));
  }
  return absl::OkStatus();
}

}  // namespace litags
