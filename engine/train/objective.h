// The loss of one rendered view and its gradient with respect to the rendered channels.
#ifndef LITAGS_ENGINE_TRAIN_OBJECTIVE_H_
#define LITAGS_ENGINE_TRAIN_OBJECTIVE_H_

#include "engine/core/image.h"
#include "engine/denoise/pdm.h"
#include "engine/render/renderer.h"
#include "engine/train/losses.h"
#include "engine/train/options.h"
#include "engine/train/step_losses.h"
#include "engine/train/train_view.h"

namespace litags {

// LITA-GS Eq. 16: L = L_exp + L_str + L_de + L_rec; or 3DGS' loss against the target image.
//
// Where a view's mask says that a pixel does not count, photo, pseudo-target and structure map are
// taken to be what is rendered there, which is held fixed: the pixel's own difference is 0, windows
// of SSIM around it see no difference in it, and it passes on no gradient, of no loss. Only the PDM
// carries gradients of pixels that count to masked ones within its reach. What the photo showed
// there changes nothing.
class Objective {
 public:
  explicit Objective(const TrainOptions& options);

  // Most channels that it wants rendered; without noise if the options have no PDM to read it.
  int NumChannels() const {
    if (!options_.recipe.lita) return kColorOnly;
    return options_.recipe.use_pdm ? int{kNumChannels} : kWithoutNoise;
  }

  // How what it compares is rendered, at the highest SH degree; without noise unless `denoise`.
  RenderSettings Settings(bool denoise) const;

  // Evaluates at `rendered` [C, H, W], with R = PDM(R_0) if `denoise`, else R = R_0. C is
  // NumChannels(), or Settings(denoise).num_channels. Writes v_rendered (same shape) and, if
  // `denoise`, v_weights. All losses and gradients are multiplied by `weight`
  // (CropGrid::WeightOf()).
  StepLosses Evaluate(const TrainView& view, const Planes& rendered, const PdmWeights& weights,
                      int iteration, bool denoise, Planes* v_rendered, PdmWeights* v_weights,
                      double weight = 1);

  // Whether the options want the PDM in this iteration.
  bool Denoises(int iteration) const {
    return options_.recipe.lita && options_.recipe.use_pdm &&
           iteration % options_.recipe.pdm_every == 0;
  }

  double denoise_seconds() const { return denoise_seconds_; }

 private:
  // LITA-GS Eq. 16, with the terms of Eq. 14 and Eq. 15.
  StepLosses EvaluateLita(const TrainView& view, const Planes& rendered, const PdmWeights& weights,
                          int iteration, bool denoise, Planes* v_rendered, PdmWeights* v_weights);
  // LITA-GS Eq. 11: L_exp, and 3DGS' loss. L1 to the pseudo-target, mixed with 1 - SSIM if the
  // options ask for it.
  double ExposureLoss(PlanesView R, PlanesSpan v_R);
  void UnpackInformation(const PlaneU8& information);
  // Masked pixels of the photo and the pseudo-target become what is rendered there.
  void HideMasked(const PlaneU8& mask, PlanesView R, PlanesView illumination);
  // So does the pseudo-target where other photos know better by far.
  void HideLowWeights(PlanesView R);
  // LITA-GS Eq. 13: L_str = L_prior and L_depth with their weights.
  void AddStructureLosses(const TrainView& view, const Planes& rendered, int iteration,
                          Planes* v_rendered, StepLosses* losses);

  TrainOptions options_;
  LossWorkspace workspace_;
  Pdm pdm_;
  Planes target_, input_, information_, structure_, v_previous_;
  DepthMap depth_;
  double weight_ = 1;  // of the view that is evaluated
  double denoise_seconds_ = 0;
};

}  // namespace litags

#endif  // LITAGS_ENGINE_TRAIN_OBJECTIVE_H_
