#include "engine/train/objective.h"

#include <algorithm>

#include "engine/core/mask.h"
#include "engine/core/monotonic_seconds.h"
#include "engine/core/parallel.h"
#include "engine/render/renderer.h"
#include "engine/target/information.h"
#include "engine/train/depth_loss.h"

namespace litags {
namespace {

// Pixels of less weight have no part in L_exp: SSIM's windows would carry their doubt to what is
// around. L_rec sees them still, for places that no other photo shows. Choice, measured
constexpr float kLowWeight = 0.25f;

// Zeros of the size of `like`, plane by plane.
void ZeroLike(int threads, PlanesView like, Planes* out) {
  out->Reshape(like.channels, like.height, like.width);
  ParallelFor(threads, like.channels, [&](size_t c, int) {
    std::fill_n(out->plane(static_cast<int>(c)), out->plane_size(), 0.0f);
  });
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

}  // namespace

Objective::Objective(const TrainOptions& options)
    : options_(options), workspace_(options.threads), pdm_(options.recipe.pdm, options.threads) {}

RenderSettings Objective::Settings(bool denoise) const {
  RenderSettings settings;
  settings.num_channels = denoise ? NumChannels() : std::min(NumChannels(), kWithoutNoise);
  settings.threads = options_.threads;
  settings.near_plane = options_.near_plane;
  settings.pixel_filter = options_.recipe.antialiased ? PixelFilter::kMip : PixelFilter::kDilate;
  if (options_.recipe.depth_geometry) settings.depth_source = DepthSource::kCameraZ;
  if (!options_.recipe.prior_geometry) settings.detached_channels = 1u << kChannelStructure;
  return settings;
}

StepLosses Objective::Evaluate(const TrainView& view, const Planes& rendered,
                               const PdmWeights& weights, int iteration, bool denoise,
                               Planes* v_rendered, PdmWeights* v_weights, double weight) {
  weight_ = weight;
  ZeroLike(options_.threads, rendered, v_rendered);
  UnpackImage(view.target, workspace_, &target_);
  UnpackInformation(view.information);
  if (options_.recipe.lita) {
    return EvaluateLita(view, rendered, weights, iteration, denoise, v_rendered, v_weights);
  }
  StepLosses losses;
  CopyMasked(view.mask, rendered, target_);
  losses.reconstruction = ExposureLoss(rendered, *v_rendered);  // 3DGS Eq. 7 is of the same form
  ZeroMasked(view.mask, *v_rendered);
  return losses;
}

StepLosses Objective::EvaluateLita(const TrainView& view, const Planes& rendered,
                                   const PdmWeights& weights, int iteration, bool denoise,
                                   Planes* v_rendered, PdmWeights* v_weights) {
  StepLosses losses;
  const PlanesView R0(rendered, kChannelColor, 3);
  const PlanesView illumination(rendered, kChannelIllumination, 3);
  const int stages = options_.recipe.pdm.stages;
  if (denoise) {
    const double start = MonotonicSeconds();
    pdm_.Forward(weights, R0, PlanesView(rendered, kChannelNoise, 3));
    denoise_seconds_ += MonotonicSeconds() - start;
  }
  const PlanesView R = denoise ? PlanesView(pdm_.R(stages)) : R0;
  const PlanesSpan v_color(*v_rendered, kChannelColor, 3);  // dL/dR, in the end dL/dR_0

  UnpackImage(view.photo, workspace_, &input_);
  HideMasked(view.mask, R, illumination);
  HideLowWeights(R);
  const Recipe& recipe = options_.recipe;
  losses.exposure = ExposureLoss(R, v_color);
  losses.reconstruction = ProductReconstructionLoss(
      R, illumination, input_, weight_ * recipe.weight_reconstruction, v_color,
      PlanesSpan(*v_rendered, kChannelIllumination, 3), workspace_, {}, information_);
  if (denoise) {
    ZeroLike(options_.threads, R, &v_previous_);
    const PlanesView previous = stages > 1 ? PlanesView(pdm_.R(stages - 1)) : R0;
    losses.denoise =
        MseLoss(R, previous, weight_ * recipe.weight_denoise, v_color, v_previous_, workspace_) +
        TvLoss(R, TvNorm::kSquared, weight_ * recipe.weight_tv, v_color, workspace_);
    ZeroMasked(view.mask, v_previous_);
  }
  AddStructureLosses(view, rendered, iteration, v_rendered, &losses);
  ZeroMasked(view.mask, *v_rendered);
  if (denoise) {
    const double start = MonotonicSeconds();
    pdm_.Backward(PlanesView(*v_rendered, kChannelColor, 3), v_previous_, v_color,
                  PlanesSpan(*v_rendered, kChannelNoise, 3), v_weights);
    denoise_seconds_ += MonotonicSeconds() - start;
  }
  return losses;
}

void Objective::UnpackInformation(const PlaneU8& information) {
  if (information.empty()) {
    information_ = Planes();
    return;
  }
  UnpackPlane(information, 1.0f / kInformationOne, workspace_, &information_);
}

void Objective::HideMasked(const PlaneU8& mask, PlanesView R, PlanesView illumination) {
  CopyMasked(mask, R, target_);
  for (int c = 0; c < 3; ++c) {
    ForMasked(mask,
              [&](size_t i) { input_.plane(c)[i] = R.plane(c)[i] * illumination.plane(c)[i]; });
  }
}

void Objective::HideLowWeights(PlanesView R) {
  const size_t width = information_.width;
  ParallelFor(options_.threads, information_.height, [&](size_t y, int) {
    for (size_t i = y * width; i < (y + 1) * width; ++i) {
      if (information_.data[i] >= kLowWeight) continue;
      for (int c = 0; c < 3; ++c) target_.plane(c)[i] = R.plane(c)[i];
    }
  });
}

double Objective::ExposureLoss(PlanesView R, PlanesSpan v_R) {
  const double ssim = options_.recipe.exposure_ssim,
               weight = weight_ * options_.recipe.weight_exposure;
  if (ssim == 0) return L1Loss(R, target_, weight, v_R, workspace_, information_);
  return ReconstructionLoss(R, target_, weight, v_R, workspace_, {.l1 = 1 - ssim, .ssim = ssim},
                            information_);
}

void Objective::AddStructureLosses(const TrainView& view, const Planes& rendered, int iteration,
                                   Planes* v_rendered, StepLosses* losses) {
  if (options_.recipe.use_prior && !view.structure.empty()) {
    UnpackPlane(view.structure, 1.0f / 255.0f, workspace_, &structure_);
    CopyMasked(view.mask, PlanesView(rendered, kChannelStructure, 1), structure_);
    losses->prior = L1Loss(PlanesView(rendered, kChannelStructure, 1), structure_,
                           weight_ * options_.recipe.weight_prior,
                           PlanesSpan(*v_rendered, kChannelStructure, 1), workspace_);
  }
  if (options_.recipe.use_depth && view.depth.has_value()) {
    const DepthMap* map = &*view.depth;
    if (map->depth.width != rendered.width || map->depth.height != rendered.height) {
      ResizeDepth(*map, rendered.width, rendered.height, workspace_.threads, &depth_);
      map = &depth_;
    }
    const std::vector<PixelRect> patches =
        DrawDepthPatches(rendered.width, rendered.height, options_.seed, iteration);
    const PlanesView confidence =
        map->confidence.empty() ? PlanesView() : PlanesView(map->confidence);
    losses->depth = DepthLoss(PlanesView(rendered, kChannelDepth, 1), map->depth, confidence,
                              patches, weight_ * options_.recipe.weight_depth,
                              PlanesSpan(*v_rendered, kChannelDepth, 1), workspace_)
                        .Sum();
  }
}

}  // namespace litags
