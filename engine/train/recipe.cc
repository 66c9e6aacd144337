#include "engine/train/recipe.h"

namespace litags {
namespace {

constexpr double k3dgsSsim = 0.2;  // 3DGS Eq. 7

// Full size from the start, and whole photos where they are large, cost a multiple of the time for
// no quality that was measured (docs/experiments/performance.md). Plain 3DGS has it, too, where
// methods are compared.
void SetPixelsOfIterations(Recipe* recipe) {
  recipe->coarse_levels = 4;      // of photos of 1600 px; smaller ones have fewer
  recipe->crop_pixels = 200'000;  // about the photos that the paper trains on. Choice
}

}  // namespace

Recipe LitagsPaper() { return Recipe(); }

Recipe Litags() {
  Recipe r;
  // One exposure for the capture, from what well exposed photos are like (exposure_rule.h): the
  // paper's gain on codes, photo by photo, clips and flattens.
  r.tone.rule = Tone::kCapture;
  r.information_weights = true;
  // Dark photos give few sparse points; stereo's take the place of thousands of iterations.
  r.dense_start = true;
  r.stereo_photos = 32;  // more do not change the loss and cost time
  // Moves Gaussians to surfaces. The paper's weight of 0.1 pulls them off the photos' edges there.
  r.depth_geometry = true;
  r.weight_depth = 0.01;
  // Costs a third of training and half of a picture's time for nothing that was measured beside the
  // noise filter (docs/experiments/denoising.md). With it, half as wide and half as often as the
  // paper has the same quality.
  r.use_pdm = false;
  r.pdm.hidden = 8;
  r.pdm_every = 2;
  r.noise_filter = true;
  // The map of edges helps no picture when it moves Gaussians
  // (docs/experiments/structure-prior.md).
  r.prior_geometry = false;
  r.antialiased = true;
  r.exposure_ssim = k3dgsSsim;  // L1 alone blurs
  // Noise of single photos is averaged rather than followed (docs/experiments/long-runs.md).
  r.lr_decay_epochs = 25;
  r.dropout = 0.35;
  SetPixelsOfIterations(&r);
  // Halves keep the picture while they grow, which short runs need; they learn their shapes faster,
  // grow for longer on captures of many photos, and need limits that clones had by their size
  // (docs/experiments/start-and-growth.md).
  r.growth = Growth::kLongAxis;
  r.densify_epochs = 60;
  r.lr_scales = 0.01;
  r.max_scale = 0.5;
  r.near_camera_pruning = 0.5;
  return r;
}

Recipe Plain3dgs() {
  Recipe r;
  r.lita = false;
  r.tone.rule = Tone::kNone;
  r.use_pdm = r.use_prior = false;
  r.use_depth = false;
  r.exposure_ssim = k3dgsSsim;
  // As in Litags(), so that a comparison is not one of schedules.
  r.lr_decay_epochs = 25;
  SetPixelsOfIterations(&r);
  return r;
}

Recipe RecipeOf(Method method) {
  switch (method) {
    case Method::kLitags:
      break;
    case Method::k3dgs:
      return Plain3dgs();
    case Method::kLitagsPaper:
      return LitagsPaper();
  }
  return Litags();
}

Recipe WithoutPdm(Recipe recipe) {
  recipe.use_pdm = false;
  return recipe;
}

Recipe WithoutDepth(Recipe recipe) {
  recipe.use_depth = recipe.dense_start = false;
  return recipe;
}

Recipe WithoutPrior(Recipe recipe) {
  recipe.use_prior = false;
  return recipe;
}

Recipe WithoutNoiseFilter(Recipe recipe) {
  recipe.noise_filter = false;
  return recipe;
}

Recipe WithPdm(Recipe recipe) {
  recipe.use_pdm = true;
  return recipe;
}

Recipe WithPriorGeometry(Recipe recipe) {
  recipe.use_prior = recipe.prior_geometry = true;
  return recipe;
}

}  // namespace litags
