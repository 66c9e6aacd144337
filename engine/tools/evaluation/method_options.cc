#include "engine/tools/evaluation/method_options.h"

#include <CLI/CLI.hpp>
#include <map>
#include <string>

namespace litags {

void AddMethodOptions(CLI::App* app, ReconstructOptions* options) {
  const std::map<std::string, Method> methods = {{"litags", Method::kLitaGs},
                                                 {"3dgs", Method::k3dgs}};
  const std::map<std::string, Tone> tones = {{"capture", Tone::kCapture},
                                             {"linear", Tone::kLinearGain},
                                             {"paper", Tone::kPaper},
                                             {"none", Tone::kNone}};
  app->add_option("--method", options->method, "litags or 3dgs")
      ->transform(CLI::CheckedTransformer(methods));
  app->add_option("--tone", options->tone, "pseudo-target: capture, linear, paper or none")
      ->transform(CLI::CheckedTransformer(tones));
  app->add_option("--theta", options->theta, "mean brightness of the target; 0: 0.49")
      ->capture_default_str();
  app->add_option("--contrast", options->contrast, "of --tone capture; 0: none")
      ->capture_default_str();
  app->add_option("--chroma-smoothing", options->chroma_smoothing,
                  "of --tone capture: colours are averaged over neighbours alike up to this many "
                  "deviations of the noise; 0: never")
      ->capture_default_str();
  app->add_option("--exposure-ssim", options->exposure_ssim, "share of 1 - SSIM beside L1 in L_exp")
      ->capture_default_str();
  app->add_option("--iterations", options->iterations, "one photo each")->capture_default_str();
  app->add_option(
         "--schedule-iterations", options->schedule_iterations,
         "lay out rates and densities for so many, the rest goes on at the last rates; with "
         "the same -o and more --iterations, a finished scene is trained further; 0: all")
      ->capture_default_str();
  app->add_option("--coarse-levels", options->coarse_levels,
                  "start on photos of 2^-n of their size; 0: full size throughout")
      ->capture_default_str();
  app->add_option("--settle-epochs", options->settle_epochs,
                  "learning rates fall from here on, epochs at full size; 0: constant")
      ->capture_default_str();
  app->add_option(
         "--dropout", options->dropout,
         "share of the Gaussians that an iteration of litags leaves out, after many epochs on "
         "noisy photos")
      ->capture_default_str();
  app->add_option("--coarse-until", options->coarse_until, "part of the run on smaller photos")
      ->capture_default_str();
  app->add_option("--seed", options->seed)->capture_default_str();
  app->add_option("--threads", options->threads, "0: all cores")->capture_default_str();
  app->add_option("--max-gaussians", options->max_gaussians)->capture_default_str();
  const std::map<std::string, DensityStatistic> statistics = {{"mean", DensityStatistic::kMean},
                                                              {"abs", DensityStatistic::kAbs},
                                                              {"pixel", DensityStatistic::kPixel}};
  app->add_option("--density-statistic", options->density_statistic,
                  "gradient that makes Gaussians split: mean, abs (AbsGS) or pixel (Pixel-GS)")
      ->transform(CLI::CheckedTransformer(statistics));
  const std::map<std::string, DensityGrowth> growths = {
      {"long-axis", DensityGrowth::kLongAxis}, {"clone-split", DensityGrowth::kCloneSplit}};
  app->add_option("--density-growth", options->density_growth,
                  "Gaussians that split become: long-axis, halves side by side, or clone-split, as "
                  "3DGS has it")
      ->transform(CLI::CheckedTransformer(growths));
  app->add_flag("!--no-antialiasing", options->antialiased,
                "Gaussians smaller than a pixel grow, as 3DGS has it");
  app->add_option("--sh-degree", options->sh_degree)->capture_default_str();
  app->add_flag("!--no-dense-start", options->dense_start,
                "start from the sparse points alone, not from stereo's, too");
  app->add_option("--max-image-side", options->max_image_side,
                  "shrink larger photos to this, px; 0: never");
  app->add_option("--holdout-every", options->holdout_every, "hold out every n-th photo; 0: none")
      ->capture_default_str();
  app->add_flag("--pdm,!--no-pdm", options->use_pdm,
                "with the paper's denoising module; without by default");
  app->add_flag(
      "!--no-noise-filter", options->noise_filter,
      "pictures are not smoothed where they show no more than the photos' rounding explains");
  app->add_option("--pdm-hidden", options->pdm_hidden, "channels inside its network")
      ->capture_default_str();
  app->add_option("--pdm-every", options->pdm_every, "iterations between those that denoise")
      ->capture_default_str();
  app->add_flag("--information-weights", options->information_weights,
                "pixels that noise, rounding or clipping spoilt weigh less");
  app->add_flag("!--no-prior", options->use_prior, "without the structure prior");
  app->add_flag(
      "--prior-geometry", options->prior_geometry,
      "the structure prior moves Gaussians, as in the paper; else it trains its map alone");
  const std::map<std::string, DepthOrigin> sources = {{"auto", DepthOrigin::kAuto},
                                                      {"maps", DepthOrigin::kMaps},
                                                      {"stereo", DepthOrigin::kStereo},
                                                      {"network", DepthOrigin::kNetwork},
                                                      {"none", DepthOrigin::kNone}};
  app->add_option(
         "--depth-source", options->depth_source,
         "depth maps: maps, stereo of all photos, network, none, or auto: maps if given, else "
         "stereo of up to 32 photos")
      ->transform(CLI::CheckedTransformer(sources));
  app->add_option("--depth-weight", options->depth_weight, "of the depth loss")
      ->capture_default_str();
  app->add_flag("--depth-geometry,!--depth-attribute", options->depth_geometry,
                "the depth loss sees the Gaussians' distance, not an attribute of theirs");
  app->add_flag("!--no-depth", options->use_depth, "without the depth loss");
}

}  // namespace litags
