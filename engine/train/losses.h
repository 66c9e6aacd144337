// Image losses of training and their gradients (LITA-GS Sec. "Unsupervised Optimization
// Strategy"). Depth is in depth_loss.h.
//
// Every function returns weight * L and ADDS its gradient, weight * dL/dx, to the gradient planes
// given; empty gradient planes ask for the value only. Results are the same bytes for any thread
// count. Sizes must agree (LITAGS_CHECK). No function allocates once its workspace has seen the
// size.
#ifndef LITAGS_ENGINE_TRAIN_LOSSES_H_
#define LITAGS_ENGINE_TRAIN_LOSSES_H_

#include <vector>

#include "engine/core/aligned.h"
#include "engine/core/color.h"
#include "engine/core/photo.h"

namespace litags {

// Threads and scratch memory of the loss functions; contents mean nothing between calls. One per
// thread of control.
struct LossWorkspace {
  explicit LossWorkspace(int num_threads = 0) : threads(num_threads) {}

  int threads;                   // <= 0: all cores
  AlignedFloats rows;            // per-thread row buffers
  std::vector<double> partials;  // one sum per task, added in task order
  AlignedFloats ssim_maps;       // dSSIM / d(blurred moments), rows padded with zeros
};

// Samples to sRGB-encoded float planes [3, H, W]; `planes` is reused.
void UnpackImage(const Photo& image, LossWorkspace& ws, Planes* planes);

// Bytes times `scale` to one float plane [1, H, W]; `plane` is reused.
void UnpackPlane(const PlaneU8& bytes, float scale, LossWorkspace& ws, Planes* plane);

// mean |x - y| over all samples; subgradient sign(0) = 0. If `pixel_weights` [1, H, W] is given:
// mean of pixel_weights * |x - y|, still divided by the number of samples.
double L1Loss(PlanesView x, PlanesView y, double weight, PlanesSpan v_x, LossWorkspace& ws,
              PlanesView pixel_weights = {});

// LITA-GS Eq. 14, first term.
// mean (x - y)^2; gradients for both sides, either may be empty.
double MseLoss(PlanesView x, PlanesView y, double weight, PlanesSpan v_x, PlanesSpan v_y,
               LossWorkspace& ws);

enum class TvNorm { kSquared, kAbsolute };

// LITA-GS Eq. 14, second term.
// Total variation: mean of vertical differences + mean of horizontal ones, squared or absolute,
// each over its own count ([C, H - 1, W] and [C, H, W - 1]).
double TvLoss(PlanesView x, TvNorm norm, double weight, PlanesSpan v_x, LossWorkspace& ws);

// 1 - SSIM. 11x11 Gaussian window of sigma 1.5, zero padding, C1 = 0.01^2, C2 = 0.03^2, mean over
// all samples (as 3DGS).
double SsimLoss(PlanesView x, PlanesView y, double weight, PlanesSpan v_x, LossWorkspace& ws);

struct ReconstructionWeights {
  double l1 = 0.8;    // paper, 3DGS
  double ssim = 0.2;  // paper, 3DGS
};

// l1 * mean |x - y| + ssim * (1 - SSIM(x, y)) in two passes over the image. `pixel_weights` as in
// L1Loss; they act on the L1 term only.
double ReconstructionLoss(PlanesView x, PlanesView y, double weight, PlanesSpan v_x,
                          LossWorkspace& ws, const ReconstructionWeights& weights = {},
                          PlanesView pixel_weights = {});

// LITA-GS Eq. 15.
// The same for x = reflectance * illumination (the paper's I_out = R L_r), with gradients for
// both factors; the product is never stored.
double ProductReconstructionLoss(PlanesView reflectance, PlanesView illumination, PlanesView y,
                                 double weight, PlanesSpan v_reflectance, PlanesSpan v_illumination,
                                 LossWorkspace& ws, const ReconstructionWeights& weights = {},
                                 PlanesView pixel_weights = {});

}  // namespace litags

#endif  // LITAGS_ENGINE_TRAIN_LOSSES_H_
