#ifndef LITAGS_ENGINE_TRAIN_OPTIONS_H_
#define LITAGS_ENGINE_TRAIN_OPTIONS_H_

#include <cstdint>

#include "absl/status/status.h"
#include "engine/denoise/pdm.h"
#include "engine/render/renderer.h"

namespace litags {

// How density control makes two Gaussians of one.
enum class Growth {
  kLongAxis,    // halves of it, side by side on its longest axis: nearly the same picture. Choice
  kCloneSplit,  // 3DGS: a copy in its place if it is small, two at random places in it if large
};

inline constexpr double kMaxDropout = 0.9;

// Everything that decides the result of a training run, besides the data. Defaults: the paper's
// Sec. "Implementation Details", the authors' release where that is silent, 3DGS otherwise;
// `Choice` is ours.
struct TrainOptions {
  int iterations = 15000;  // one photo each; paper
  uint64_t seed = 0;
  int threads = 0;  // 0: all cores; never changes the result

  // True: LITA-GS, 8 channels (11 with the PDM) and all losses. False: plain 3DGS on the target
  // images.
  bool lita = true;
  bool use_pdm = true;         // progressive denoising and L_de; else R = R_0
  bool use_prior = true;       // L_prior
  bool prior_geometry = true;  // it moves Gaussians (paper), else trains their attribute p alone
  bool use_depth = true;       // L_depth, for views that have a depth map
  // D_r is the Gaussians' distance along the axis, so that the loss moves them; else their own
  // attribute d (paper). Choice
  bool depth_geometry = false;
  PdmOptions pdm;
  int pdm_every = 1;  // iterations between those that denoise; the others have R = R_0. Choice

  // Loss weights; paper.
  double weight_exposure = 1.0;
  double exposure_ssim = 0.0;  // L_exp = (1 - s) L1 + s (1 - SSIM); paper: 0, [0, 1]
  double weight_reconstruction = 1.0;
  double weight_prior = 0.1;
  double weight_depth = 0.1;
  double weight_denoise = 1.0;
  double weight_tv = 1.0;

  // Learning rates; 3DGS. Those of means are times the scene's extent and fall log-linearly.
  double lr_means = 1.6e-4;
  double lr_means_final = 1.6e-6;
  double lr_sh_dc = 2.5e-3;
  double lr_sh_rest = 2.5e-3 / 20;
  double lr_opacity = 0.05;
  double lr_scales = 5e-3;
  double lr_quats = 1e-3;
  double lr_attributes = 2.5e-3;  // structure, illumination, depth, noise. Choice
  double lr_pdm = 5e-5;           // release
  // E: all rates of Gaussians but the means' are divided by 1 + e / E after e epochs (iterations
  // over views) at full size, so that noisy photos are averaged rather than followed one by one.
  // 0: constant rates, as 3DGS. Choice
  double settle_epochs = 0;
  // Share of the Gaussians that an iteration leaves out: dropout e / (e + 50) after e epochs at
  // full size. What repeats of the same photos would teach is their noise (noise.h). Choice
  double dropout = 0;  // [0, kMaxDropout]

  // Coarse to fine: the first coarse_until of the run is shared by photos of 2^-coarse_levels ..
  // 1/2 of their size, with 4^-level of max_gaussians and no denoising. 0 levels: full size
  // throughout.
  int coarse_levels = 0;  // 0..4
  double coarse_until = 0.5;

  PixelFilter pixel_filter = PixelFilter::kDilate;  // 3DGS

  // SH degree starts at min(1, sh_degree) and grows by one every sh_interval iterations; paper.
  int sh_degree = 3;  // 0..3
  int sh_interval = 1000;

  // Density control. A Gaussian's score is, over the views that saw it since the last step, kNone:
  // the mean of |dL/dmean2d| (3DGS); kAbsGradient: the mean of the same with absolute values summed
  // over pixels, so that opposite pulls do not cancel (AbsGS); kCount: the mean weighted by the
  // pixels it covered, so that large ones count where they are seen whole (Pixel-GS).
  PixelSum density_statistic = PixelSum::kNone;
  Growth growth = Growth::kCloneSplit;
  int densify_start = 500;
  int densify_every = 200;  // release; 3DGS: 100
  // Iterations of densification after the coarse part (paper), at most until half of the run; until
  // every photo was seen densify_epochs times if that is later, at most until 0.7 of the run: short
  // runs on many photos have not seen these often enough to learn their noise. Choice
  int densify_until = 5000;
  double densify_epochs = 0;
  double densify_grad = 2e-4;      // least score to grow, in units of half the image; 3DGS
  double densify_abs_grad = 8e-4;  // the same with kAbsGradient, which is larger
  double densify_percent = 0.01;  // of the extent: larger Gaussians are split, smaller cloned; 3DGS
  double prune_opacity = 0.005;   // 3DGS
  int64_t max_gaussians = 200000;
  // Largest scale, in distances from the mean to the nearest camera; what is wider is cut to it at
  // every density step, also after growth: it could stand in the way of views that no photo has.
  // 0: none is cut, as 3DGS. Choice
  double max_scale = 0;

  // Nearest that a Gaussian may be to a camera, of the distance that 99 % of the first Gaussians
  // keep from the nearest one; nearer ones are removed at density steps: photos show nothing there,
  // but for other cameras they hide everything. 0: none is, as 3DGS. Choice
  double clear_space = 0;

  // INVALID_ARGUMENT naming the field that breaks its rule.
  absl::Status Validate() const;
};

}  // namespace litags

#endif  // LITAGS_ENGINE_TRAIN_OPTIONS_H_
