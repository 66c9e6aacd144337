// The recipes: what each method optimises, with its constants and their reasons.
//
// What methods differ in lives here, or in ToneOptions and PdmOptions, which a recipe holds; the
// constants of one formula stand beside it. A constant's line in VisitFields gives it a check, a
// place in the fingerprint of checkpoints and a name for `--set NAME=VALUE` of the research tools.
#ifndef LITAGS_ENGINE_TRAIN_RECIPE_H_
#define LITAGS_ENGINE_TRAIN_RECIPE_H_

#include <utility>

#include "absl/status/status.h"
#include "engine/core/fields.h"
#include "engine/denoise/pdm_options.h"
#include "engine/target/tone_options.h"

namespace litags {

// A method that users choose by name. Values are stored with jobs.
enum class Method {
  kLitags = 0,       // LITA-GS as this project has it
  k3dgs = 1,         // plain 3D Gaussian splatting on the photos as they are
  kLitagsPaper = 2,  // LITA-GS as the paper has it
};

template <>
struct EnumWords<Method> {
  static constexpr std::pair<Method, const char*> kWords[] = {
      {Method::kLitags, "litags"}, {Method::kLitagsPaper, "litags-paper"}, {Method::k3dgs, "3dgs"}};
};

// How density control makes two Gaussians of one.
enum class Growth {
  kLongAxis,    // halves of it, side by side on its longest axis: nearly the same picture
  kCloneSplit,  // 3DGS: a copy in its place if it is small, two at random places in it if large
};

template <>
struct EnumWords<Growth> {
  static constexpr std::pair<Growth, const char*> kWords[] = {{Growth::kLongAxis, "long-axis"},
                                                              {Growth::kCloneSplit, "clone-split"}};
};

inline constexpr double kMaxDropout = 0.9;

// The constants of a method. The defaults are the paper's (Sec. "Implementation Details"), the
// authors' release where the paper is silent, 3DGS otherwise. `Choice` is ours.
struct Recipe {
  // Target: what pictures are compared with.
  ToneOptions tone = {.rule = Tone::kPaper};
  // Where exposures differ by more than a stop, pixels that noise, rounding or clipping spoilt
  // weigh less than those of photos that know better (engine/target/information.h). Choice
  bool information_weights = false;

  // Start and depth.
  bool dense_start = false;  // from points of stereo besides SfM's, as disks. Choice
  bool use_depth = true;     // L_depth, for views that have a depth map
  // Photos that stereo makes depth maps of where none are given; 0: all. Stands in for the paper's
  // depth network. Choice
  int stereo_photos = 0;
  // D_r is the Gaussians' distance along the axis, so that the loss moves them; else their own
  // attribute d (paper). Choice
  bool depth_geometry = false;

  // Model. False: plain 3DGS, without R, L, structure and their losses.
  bool lita = true;
  bool use_pdm = true;  // progressive denoising (Sec. "Progressive Denoising Module") and L_de
  PdmOptions pdm;
  int pdm_every = 1;           // iterations between those that denoise; the others have R = R_0
  bool use_prior = true;       // L_prior
  bool prior_geometry = true;  // it moves Gaussians (paper), else trains their attribute p alone
  // Gaussians smaller than a pixel become more transparent instead of larger, so that pictures keep
  // their look at other sizes than the photos' (PixelFilter::kMip). Choice
  bool antialiased = false;
  // Pictures are smoothed where they show no more than noise and rounding of the photos explain
  // (engine/denoise/noise_filter.h). Choice
  bool noise_filter = false;

  // Loss weights; paper.
  double weight_exposure = 1.0;  // of L_exp, which is all that plain 3DGS has
  double exposure_ssim = 0.0;    // L_exp = (1 - s) L1 + s (1 - SSIM); paper: 0
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
  // Of cameras, if they are refined; falls log-linearly as that of means. Radians, and for shifts
  // times the scene's extent. Choice, measured (docs/experiments/cameras.md)
  double lr_cameras = 1e-3;
  double lr_cameras_final = 1e-5;
  // E: all rates of Gaussians but the means' are divided by 1 + e / E after e epochs (iterations
  // over views) at full size. 0: constant rates, as 3DGS
  double lr_decay_epochs = 0;
  // Share of the Gaussians that an iteration leaves out: dropout e / (e + 50) after e epochs at
  // full size, changed by AdaptToNoise
  double dropout = 0;

  // Coarse to fine: the first coarse_until of the run is shared by photos of 2^-coarse_levels ..
  // 1/2 of their size, with at most coarse_gaussians for each of their pixels and no denoising. 0
  // levels: full size throughout, as the paper.
  int coarse_levels = 0;
  double coarse_until = 0.5;
  double coarse_gaussians = 1.5;  // a quarter of 200,000 for half of 270x480. Choice
  // An iteration compares a crop of about so many pixels of larger photos (engine/train/crop.h); 0:
  // whole photos, as the paper.
  int crop_pixels = 0;

  // SH degree starts at min(1, sh_degree) and grows by one every sh_interval iterations; paper.
  int sh_interval = 1000;

  // Density control. A Gaussian's score is the mean of |dL/dmean2d| over the views that saw it
  // since the last step (3DGS).
  Growth growth = Growth::kCloneSplit;
  int densify_start = 500;
  int densify_every = 200;  // release; 3DGS: 100
  // Iterations of densification after the coarse part (paper), at most until half of the run; until
  // every photo was seen densify_epochs times if that is later, at most until 0.7 of the run.
  int densify_until = 5000;
  double densify_epochs = 0;
  // Least score to grow, in units of half the larger side of the image or crop; 3DGS has the
  // number, in units of half of each axis' own side.
  double densify_grad = 2e-4;
  double densify_percent = 0.01;  // of the extent: larger Gaussians are split, smaller cloned; 3DGS
  double prune_opacity = 0.005;   // 3DGS
  // Largest scale, in distances from the mean to the nearest camera; larger ones are cut to it at
  // every density step. 0: none is cut, as 3DGS
  double max_scale = 0;
  // Near-camera pruning: Gaussians nearer to a camera than this share of the distance that 99 % of
  // the first Gaussians exceed are removed at density steps, after growth made invisible. 0: none
  // is, as 3DGS
  double near_camera_pruning = 0;

  // INVALID_ARGUMENT (BAD_OPTION) naming the constant that breaks its rule.
  absl::Status Validate() const { return CheckFields(*this, ""); }
};

template <class T, class Visit>
void VisitFields(FieldsOf<Recipe>, T& r, Visit&& visit) {
  constexpr FieldRule kAny, kWeight{.least = 0}, kShare{.least = 0, .most = 1};
  VisitFields(FieldsOf<ToneOptions>(), r.tone, visit);
  visit("information_weights", r.information_weights, kAny);
  visit("dense_start", r.dense_start, kAny);
  visit("use_depth", r.use_depth, kAny);
  visit("stereo_photos", r.stereo_photos, FieldRule{.least = 2, .most = 1e6, .zero = "all"});
  visit("depth_geometry", r.depth_geometry, kAny);
  visit("lita", r.lita, kAny);
  visit("use_pdm", r.use_pdm, kAny);
  VisitFields(FieldsOf<PdmOptions>(), r.pdm, visit);
  visit("pdm_every", r.pdm_every, FieldRule{.least = 1, .most = 1e6});
  visit("use_prior", r.use_prior, kAny);
  visit("prior_geometry", r.prior_geometry, kAny);
  visit("antialiased", r.antialiased, kAny);
  visit("noise_filter", r.noise_filter, kAny);
  visit("weight_exposure", r.weight_exposure, kWeight);
  visit("exposure_ssim", r.exposure_ssim, kShare);
  visit("weight_reconstruction", r.weight_reconstruction, kWeight);
  visit("weight_prior", r.weight_prior, kWeight);
  visit("weight_depth", r.weight_depth, kWeight);
  visit("weight_denoise", r.weight_denoise, kWeight);
  visit("weight_tv", r.weight_tv, kWeight);
  visit("lr_means", r.lr_means, kWeight);
  visit("lr_means_final", r.lr_means_final, kWeight);
  visit("lr_sh_dc", r.lr_sh_dc, kWeight);
  visit("lr_sh_rest", r.lr_sh_rest, kWeight);
  visit("lr_opacity", r.lr_opacity, kWeight);
  visit("lr_scales", r.lr_scales, kWeight);
  visit("lr_quats", r.lr_quats, kWeight);
  visit("lr_attributes", r.lr_attributes, kWeight);
  visit("lr_pdm", r.lr_pdm, kWeight);
  visit("lr_cameras", r.lr_cameras, kWeight);
  visit("lr_cameras_final", r.lr_cameras_final, kWeight);
  visit("lr_decay_epochs", r.lr_decay_epochs, kWeight);
  visit("dropout", r.dropout, FieldRule{.least = 0, .most = kMaxDropout});
  visit("coarse_levels", r.coarse_levels, FieldRule{.least = 0, .most = 4});
  visit("coarse_until", r.coarse_until, FieldRule{.least = 0, .most = 1, .above_least = true});
  visit("coarse_gaussians", r.coarse_gaussians, FieldRule{.least = 0, .above_least = true});
  visit("crop_pixels", r.crop_pixels,
        FieldRule{.least = 4096, .most = 1e9, .zero = "whole photos"});
  visit("sh_interval", r.sh_interval, FieldRule{.least = 1});
  visit("growth", r.growth, kAny);
  visit("densify_start", r.densify_start, kWeight);
  visit("densify_every", r.densify_every, FieldRule{.least = 1});
  visit("densify_until", r.densify_until, kWeight);
  visit("densify_epochs", r.densify_epochs, kWeight);
  visit("densify_grad", r.densify_grad, kWeight);
  visit("densify_percent", r.densify_percent, kWeight);
  visit("prune_opacity", r.prune_opacity, kWeight);
  visit("max_scale", r.max_scale, kWeight);
  visit("near_camera_pruning", r.near_camera_pruning, kWeight);
}

Recipe Litags();
Recipe LitagsPaper();
Recipe Plain3dgs();

Recipe RecipeOf(Method method);

// Ablations: the recipe with one thing changed.
Recipe WithoutPdm(Recipe recipe);    // without the PDM and its loss L_de: R = R_0
Recipe WithoutDepth(Recipe recipe);  // without L_depth and without the start from stereo
// Without L_prior. That of Litags() trains its own map only, so that pictures stay the same.
Recipe WithoutPrior(Recipe recipe);
Recipe WithoutNoiseFilter(Recipe recipe);
Recipe WithPdm(Recipe recipe);  // beside the noise filter if the recipe has one
Recipe WithPriorGeometry(Recipe recipe);

}  // namespace litags

#endif  // LITAGS_ENGINE_TRAIN_RECIPE_H_
