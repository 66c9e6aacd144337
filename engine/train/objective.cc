#include "engine/train/objective.h"

#include <algorithm>
#include <chrono>

#include "engine/core/mask.h"
#include "engine/priors/information.h"
#include "engine/render/renderer.h"
#include "engine/train/depth_loss.h"
#include "engine/train/model.h"

namespace litags {
namespace {

void ZeroLike(const Planes& like, int channels, Planes* out) {
  out->channels = channels;
  out->height = like.height;
  out->width = like.width;
  out->data.assign(channels * like.plane_size(), 0.0f);
}

// to = from at masked pixels, plane by plane.
void CopyMasked(const PlaneU8& mask, PlanesView from, PlanesSpan to) {
  for (int c = 0; c < to.channels; ++c) {
    ForMasked(mask, [&](size_t i) { to.plane(c)[i] = from.plane(c)[i]; });
  }
}

void ZeroMasked(const PlaneU8& mask, PlanesSpan v) {
  for (int c = 0; c < v.channels; ++c) {
    ForMasked(mask, [&](size_t i) { v.plane(c)[i] = 0; });
  }
}

double Seconds() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

}  // namespace

Objective::Objective(const TrainOptions& options)
    : options_(options), workspace_(options.threads), pdm_(options.pdm, options.threads) {}

StepLosses Objective::Evaluate(const TrainView& view, const Planes& rendered,
                               const PdmWeights& weights, int iteration, bool denoise,
                               Planes* v_rendered, PdmWeights* v_weights) {
  ZeroLike(rendered, rendered.channels, v_rendered);
  UnpackImage(view.target, workspace_, &target_);
  UnpackInformation(view.information);
  if (options_.lita) {
    return EvaluateLita(view, rendered, weights, iteration, denoise, v_rendered, v_weights);
  }
  StepLosses losses;
  CopyMasked(view.mask, rendered, target_);
  losses.reconstruction = ReconstructionLoss(rendered, target_, 1.0, *v_rendered, workspace_);
  ZeroMasked(view.mask, *v_rendered);
  return losses;
}

StepLosses Objective::EvaluateLita(const TrainView& view, const Planes& rendered,
                                   const PdmWeights& weights, int iteration, bool denoise,
                                   Planes* v_rendered, PdmWeights* v_weights) {
  StepLosses losses;
  CopyPlanes(rendered, kChannelColor, &color_);
  const int stages = options_.pdm.stages;
  if (denoise) {
    const double start = Seconds();
    CopyPlanes(rendered, kChannelNoise, &noise_);
    pdm_.Forward(weights, color_, noise_);
    denoise_seconds_ += Seconds() - start;
  }
  const Planes& R = denoise ? pdm_.R(stages) : color_;
  ZeroLike(R, 3, &v_color_);

  UnpackImage(view.photo, workspace_, &input_);
  HideMasked(view.mask, R, PlanesView(rendered, kChannelIllumination, 3));
  losses.exposure = options_.weight_exposure * ExposureLoss(R);
  losses.reconstruction =
      options_.weight_reconstruction *
      ProductReconstructionLoss(
          R, PlanesView(rendered, kChannelIllumination, 3), input_, options_.weight_reconstruction,
          v_color_, PlanesSpan(*v_rendered, kChannelIllumination, 3), workspace_, {}, information_);
  if (denoise) {
    ZeroLike(R, 3, &v_previous_);
    const Planes& previous = stages > 1 ? pdm_.R(stages - 1) : color_;
    losses.denoise =
        options_.weight_denoise *
            MseLoss(R, previous, options_.weight_denoise, v_color_, v_previous_, workspace_) +
        options_.weight_tv * TvLoss(R, TvNorm::kSquared, options_.weight_tv, v_color_, workspace_);
    ZeroMasked(view.mask, v_previous_);
  }
  AddStructure(view, rendered, iteration, v_rendered, &losses);
  ZeroMasked(view.mask, v_color_);
  ZeroMasked(view.mask, *v_rendered);

  const size_t n = 3 * rendered.plane_size();
  if (!denoise) {
    std::copy_n(v_color_.data.data(), n, v_rendered->plane(kChannelColor));
    return losses;
  }
  const double start = Seconds();
  pdm_.Backward(v_color_, v_previous_, &v_r0_, &v_noise_, v_weights);
  std::copy_n(v_r0_.data.data(), n, v_rendered->plane(kChannelColor));
  std::copy_n(v_noise_.data.data(), n, v_rendered->plane(kChannelNoise));
  denoise_seconds_ += Seconds() - start;
  return losses;
}

void Objective::UnpackInformation(const PlaneU8& information) {
  if (information.empty()) {
    information_ = Planes();
    return;
  }
  UnpackPlane(information, workspace_, &information_);
  for (float& weight : information_.data) weight *= 255.0f / kInformationOne;
}

void Objective::HideMasked(const PlaneU8& mask, const Planes& R, PlanesView illumination) {
  CopyMasked(mask, R, target_);
  for (int c = 0; c < 3; ++c) {
    ForMasked(mask,
              [&](size_t i) { input_.plane(c)[i] = R.plane(c)[i] * illumination.plane(c)[i]; });
  }
}

double Objective::ExposureLoss(const Planes& R) {
  const double ssim = options_.exposure_ssim, weight = options_.weight_exposure;
  if (ssim == 0) return L1Loss(R, target_, weight, v_color_, workspace_, information_);
  return ReconstructionLoss(R, target_, weight, v_color_, workspace_,
                            {.l1 = 1 - ssim, .ssim = ssim}, information_);
}

void Objective::AddStructure(const TrainView& view, const Planes& rendered, int iteration,
                             Planes* v_rendered, StepLosses* losses) {
  if (options_.use_prior && !view.structure.empty()) {
    UnpackPlane(view.structure, workspace_, &structure_);
    CopyMasked(view.mask, PlanesView(rendered, kChannelStructure, 1), structure_);
    losses->prior =
        options_.weight_prior * L1Loss(PlanesView(rendered, kChannelStructure, 1), structure_,
                                       options_.weight_prior,
                                       PlanesSpan(*v_rendered, kChannelStructure, 1), workspace_);
  }
  if (options_.use_depth && view.depth.has_value()) {
    const std::vector<Patch> patches = DrawDepthPatches(
        rendered.width, rendered.height, DepthPatchOptions(), options_.seed, iteration);
    const PlanesView confidence =
        view.depth->confidence.empty() ? PlanesView() : PlanesView(view.depth->confidence);
    losses->depth =
        options_.weight_depth * DepthLoss(PlanesView(rendered, kChannelDepth, 1), view.depth->depth,
                                          confidence, patches, options_.weight_depth,
                                          PlanesSpan(*v_rendered, kChannelDepth, 1), workspace_)
                                    .Sum();
  }
}

}  // namespace litags
