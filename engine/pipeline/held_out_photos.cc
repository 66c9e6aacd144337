#include "engine/pipeline/held_out_photos.h"

#include <algorithm>
#include <cmath>

#include "engine/core/error.h"
#include "engine/core/mask.h"
#include "engine/eval/metrics.h"
#include "engine/train/fit_camera.h"
#include "engine/train/losses.h"

namespace litags {
namespace {

constexpr size_t kScoredOfPreview = 16;

// Makes pixels that do not count equal, and returns how many there are for each that counts.
double FillUncounted(const PlaneU8& mask, const Planes& color, Planes* target) {
  for (int c = 0; c < target->channels; ++c) {
    ForMasked(mask, [&](size_t i) { target->plane(c)[i] = color.plane(c)[i]; });
  }
  return static_cast<double>(color.plane_size()) / CountedPixels(mask, color.plane_size());
}

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
  double psnr_sum = 0, ssim_sum = with_ssim ? 0 : kNotMeasured;
  for (size_t k = 0; k < count; ++k) {
    if (cancel.IsCancelled()) return cancel.Check();
    const size_t i = k * photos_.size() / count;
    const TrainView& photo = photos_[i];
    renderer.RenderColor(model, views_[i].camera, &color, photo.lamp);
    for (float& x : color.data) x = std::clamp(x, 0.0f, 1.0f);
    UnpackImage(photo.target, workspace, &target);
    const double dilution = FillUncounted(photo.mask, color, &target);
    LITAGS_ASSIGN_OR_RETURN(const double psnr, Psnr(color, target));
    psnr_sum += psnr - 10 * std::log10(dilution);
    if (!with_ssim) continue;
    const absl::StatusOr<double> ssim = Ssim(color, target, SsimBorder::kValid, threads_);
    ssim_sum += ssim.ok() ? 1 - (1 - *ssim) * dilution : kNotMeasured;
  }
  const auto n = static_cast<double>(count);
  return HeldOutScores{psnr_sum / n, ssim_sum / n};
}

absl::Status HeldOutPhotos::FitCameras(const TrainOptions& options, const Model& model,
                                       double extent,
                                       const std::function<void(size_t placed)>& on_photo,
                                       const CancelToken& cancel) {
  for (size_t i = 0; i < photos_.size(); ++i) {
    on_photo(i);
    LITAGS_ASSIGN_OR_RETURN(views_[i].camera,
                            FitCamera(options, model, photos_[i], extent, cancel));
  }
  return absl::OkStatus();
}

}  // namespace litags
