#include "engine/tools/evaluation/method_options.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"

namespace litags {
namespace {

template <class Value>
using Choices = std::vector<std::pair<std::string, Value>>;

// An option that takes one of a few words; the first is the default.
template <class Value, class Use>
void AddChoice(CLI::App* app, const std::string& name, const Choices<Value>& choices, Use use,
               const std::string& help) {
  app->add_option_function<std::string>(
         name,
         [name, choices, use](const std::string& word) {
           const auto found = std::find_if(choices.begin(), choices.end(), [&](const auto& choice) {
             return choice.first == word;
           });
           if (found != choices.end()) return use(found->second);
           throw CLI::ValidationError(
               name, absl::StrCat("there is no \"", word, "\"; choose one of: ",
                                  absl::StrJoin(choices, " ", [](std::string* out, const auto& c) {
                                    out->append(c.first);
                                  })));
         },
         help)
      ->default_str(choices.front().first);
}

template <class Value>
void AddChoice(CLI::App* app, const std::string& name, Value* value, const Choices<Value>& choices,
               const std::string& help) {
  AddChoice(
      app, name, choices, [value](Value chosen) { *value = chosen; }, help);
}

}  // namespace

ReconstructOptions PaperSettings(ReconstructOptions options) {
  options.method = Method::kLitaGs;
  options.tone = Tone::kPaper;
  options.exposure_ssim = 0;
  options.depth_source = DepthOrigin::kStereo;  // in place of the paper's network
  options.depth_weight = 0.1;
  options.depth_geometry = false;
  options.dense_start = false;
  options.noise_filter = false;
  options.use_pdm = true;
  options.density_statistic = DensityStatistic::kMean;
  options.density_growth = DensityGrowth::kCloneSplit;
  options.antialiased = false;
  options.prior_geometry = true;
  options.pdm_hidden = 16;
  options.pdm_every = 1;
  options.coarse_levels = 0;
  options.settle_epochs = 0;
  options.dropout = 0;
  options.information_weights = false;
  return options;
}

ReconstructOptions WithoutPdm(ReconstructOptions options) {
  options.use_pdm = false;
  return options;
}

ReconstructOptions WithoutDepth(ReconstructOptions options) {
  options.use_depth = false;
  options.dense_start = false;
  return options;
}

ReconstructOptions WithoutPrior(ReconstructOptions options) {
  options.use_prior = false;
  return options;
}

ReconstructOptions WithoutNoiseFilter(ReconstructOptions options) {
  options.noise_filter = false;
  return options;
}

ReconstructOptions WithPdm(ReconstructOptions options) {
  options.use_pdm = true;
  return options;
}

ReconstructOptions WithPriorGeometry(ReconstructOptions options) {
  options.use_prior = options.prior_geometry = true;
  return options;
}

void AddMethodOptions(CLI::App* app, ReconstructOptions* options) {
  // First of all, so that the options beside it change what the method sets.
  const Choices<ReconstructOptions (*)(ReconstructOptions)> methods = {
      {"litags", [](ReconstructOptions given) { return given; }},
      {"litags-paper", PaperSettings},
      {"3dgs", [](ReconstructOptions given) {
         given.method = Method::k3dgs;
         return given;
       }}};
  AddChoice(
      app, "--method", methods, [options](auto settings) { *options = settings(*options); },
      "litags, litags-paper (all as the paper has it, but for stereo in place of its depth "
      "network), or 3dgs");
  AddChoice(app, "--tone", &options->tone,
            {{"capture", Tone::kCapture},
             {"linear-gain", Tone::kLinearGain},
             {"paper", Tone::kPaper},
             {"none", Tone::kNone}},
            "pseudo-target: capture, linear-gain, paper or none");
  app->add_option("--theta", options->theta, "mean brightness of the target; 0: 0.49")
      ->capture_default_str();
  app->add_option("--contrast", options->contrast, "of --tone capture; 0: none")
      ->capture_default_str();
  app->add_option("--chroma-smoothing", options->chroma_smoothing,
                  "of --tone capture: colours are averaged over neighbours alike up to this many "
                  "deviations of the noise; 0: never")
      ->capture_default_str();
  AddChoice(app, "--white-balance", &options->white_balance,
            {{"camera", WhiteBalance::kCamera}, {"scene", WhiteBalance::kScene}},
            "of --tone capture: scene neutralises a strong cast, as of sodium lamps; camera "
            "keeps it");
  app->add_option("--exposure-ssim", options->exposure_ssim,
                  "share of 1 - SSIM beside L1 in L_exp, less on very noisy photos")
      ->capture_default_str();
  app->add_option("--iterations", options->iterations, "one photo each")->capture_default_str();
  app->add_option(
         "--schedule-iterations", options->schedule_iterations,
         "lay out rates and densities for so many, the rest goes on at the last rates; with "
         "the same -o and more --iterations, litags-train trains a finished scene further; 0: all")
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
  AddChoice(app, "--density-statistic", &options->density_statistic,
            {{"mean", DensityStatistic::kMean},
             {"abs", DensityStatistic::kAbs},
             {"pixel", DensityStatistic::kPixel}},
            "gradient that makes Gaussians split: mean, abs (AbsGS) or pixel (Pixel-GS)");
  AddChoice(app, "--density-growth", &options->density_growth,
            {{"long-axis", DensityGrowth::kLongAxis}, {"clone-split", DensityGrowth::kCloneSplit}},
            "Gaussians that split become: long-axis, halves side by side, or clone-split, as 3DGS "
            "has it");
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
  app->add_flag("!--no-noise-filter", options->noise_filter,
                "pictures are not smoothed where they show no more than the photos' noise and "
                "rounding explain");
  app->add_option("--pdm-hidden", options->pdm_hidden, "channels inside its network")
      ->capture_default_str();
  app->add_option("--pdm-every", options->pdm_every, "iterations between those that denoise")
      ->capture_default_str();
  app->add_flag("!--no-information-weights", options->information_weights,
                "photos of other exposure that know a place better do not count for more");
  app->add_flag("!--no-prior", options->use_prior, "without the structure prior");
  app->add_flag(
      "--prior-geometry", options->prior_geometry,
      "the structure prior moves Gaussians, as in the paper; else it trains its map alone");
  AddChoice(app, "--depth-source", &options->depth_source,
            {{"auto", DepthOrigin::kAuto},
             {"maps", DepthOrigin::kMaps},
             {"stereo", DepthOrigin::kStereo},
             {"network", DepthOrigin::kNetwork},
             {"none", DepthOrigin::kNone}},
            "depth maps: maps, stereo of all photos, network, none, or auto: maps if given, else "
            "stereo of up to 32 photos");
  app->add_option("--depth-weight", options->depth_weight, "of the depth loss")
      ->capture_default_str();
  app->add_flag("--depth-geometry,!--depth-attribute", options->depth_geometry,
                "the depth loss sees the Gaussians' distance, not an attribute of theirs");
  app->add_flag("!--no-depth", options->use_depth, "without the depth loss");
}

}  // namespace litags
