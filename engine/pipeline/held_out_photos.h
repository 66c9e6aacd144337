#ifndef LITAGS_ENGINE_PIPELINE_HELD_OUT_PHOTOS_H_
#define LITAGS_ENGINE_PIPELINE_HELD_OUT_PHOTOS_H_

#include <cstddef>
#include <functional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "engine/core/camera.h"
#include "engine/core/cancel.h"
#include "engine/pipeline/report.h"
#include "engine/train/model.h"
#include "engine/train/options.h"
#include "engine/train/train_view.h"

namespace litags {

struct HeldOutScores {
  double psnr = kNotMeasured;  // dB; both are means over photos, of the pixels that count
  double ssim = kNotMeasured;
};

// The photos that are not learnt: a scene is scored by them.
class HeldOutPhotos {
 public:
  // `photos` must outlive this. Threads as in ReconstructOptions.
  HeldOutPhotos(const std::vector<TrainView>* photos, int threads);

  // Their cameras as they are known now.
  const std::vector<View>& views() const { return views_; }

  // Pictures of `model` against the photos' targets. PSNR of 16 of them, spread over all: rendering
  // takes long. CANCELLED.
  absl::StatusOr<HeldOutScores> ScoreSome(ModelRenderer& renderer, const Model& model,
                                          const CancelToken& cancel) const;

  // The same of all, with SSIM, which takes longer. NaN where a photo is below 11 px.
  absl::StatusOr<HeldOutScores> ScoreAll(ModelRenderer& renderer, const Model& model,
                                         const CancelToken& cancel) const;

  // Places the photos in a scene whose cameras were refined: photos that are not learnt do not move
  // their cameras while the others move theirs. `options` and `extent` as in FitCamera. Calls
  // on_photo before each, with how many are placed. Adds a note of those where a number was not
  // finite. CANCELLED within a step.
  absl::Status FitCameras(const TrainOptions& options, const Model& model, double extent,
                          const std::function<void(size_t placed)>& on_photo,
                          const CancelToken& cancel, std::vector<std::string>* notes);

 private:
  absl::StatusOr<HeldOutScores> Score(size_t count, bool with_ssim, ModelRenderer& renderer,
                                      const Model& model, const CancelToken& cancel) const;

  const std::vector<TrainView>& photos_;
  const int threads_;
  std::vector<View> views_;
};

}  // namespace litags

#endif  // LITAGS_ENGINE_PIPELINE_HELD_OUT_PHOTOS_H_
