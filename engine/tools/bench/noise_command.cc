// litags-bench noise: what is left of the photos' noise in renders of the same views.
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "CLI/App.hpp"
#include "CLI/Config.hpp"
#include "CLI/Formatter.hpp"
#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "engine/core/json_text.h"
#include "engine/eval/metrics.h"
#include "engine/eval/noise.h"
#include "engine/io/image_io.h"
#include "engine/pipeline/capture_targets.h"
#include "engine/tools/bench/command_options.h"
#include "engine/tools/bench/commands.h"
#include "engine/tools/evaluation/benchmark_scene.h"
#include "proto/arguments/arguments.h"

namespace litags {
namespace {

struct NoiseArguments {
  BenchmarkScene scene;
  std::string pictures, again, json;
  double flat_share = kFlatShare;
};

// Pictures of the same views, in one order.
struct Pictures {
  std::vector<ImageU8> renders, again, truths;
  std::vector<Photo> photos;
};

// Of the test views that have a render.
absl::StatusOr<Pictures> ReadPictures(const NoiseArguments& args) {
  LITAGS_ASSIGN_OR_RETURN(const std::vector<TestView> views, args.scene.TestViews());
  Pictures out;
  for (const TestView& view : views) {
    const absl::StatusOr<std::string> render = FindPhoto(args.pictures, view.view.name);
    if (absl::IsNotFound(render.status())) continue;
    LITAGS_RETURN_IF_ERROR(render.status());
    LITAGS_ASSIGN_OR_RETURN(out.renders.emplace_back(), ReadImage(*render, *render));
    LITAGS_ASSIGN_OR_RETURN(out.photos.emplace_back(), LoadPhoto(args.scene.PhotosDir(), view));
    LITAGS_ASSIGN_OR_RETURN(out.truths.emplace_back(), LoadPicture(args.scene.TruthDir(), view));
    if (args.again.empty()) continue;
    LITAGS_ASSIGN_OR_RETURN(const std::string again, FindPhoto(args.again, view.view.name));
    LITAGS_ASSIGN_OR_RETURN(out.again.emplace_back(), ReadImage(again, again));
  }
  if (!out.renders.empty()) return out;
  return MakeError(
      absl::StatusCode::kNotFound, "NO_PICTURES", "pictures",
      absl::StrCat(args.pictures, " has no picture named as a test view of ", args.scene.dir));
}

// Of the renders and those of the other scene; mean over the views.
absl::StatusOr<double> NoiseOfTwo(const Pictures& p, double flat_share) {
  double sum = 0;
  for (size_t i = 0; i < p.renders.size(); ++i) {
    LITAGS_ASSIGN_OR_RETURN(const double noise,
                            NoiseBetween(ToPlanes(p.renders[i]), ToPlanes(p.again[i]),
                                         FlatPixels(ToPlanes(p.truths[i]), flat_share)));
    sum += noise;
  }
  return sum / p.renders.size();
}

// Means over the views.
struct Quality {
  double noise = 0, ssim = 0, psnr = 0;
};

// Of pictures of one origin. The truth is brought to their tone by one affine colour map for all
// views (in this direction: the truth has no noise that would flatten the fit), so that contrast
// left in a flat area is not taken for noise.
absl::StatusOr<Quality> Measure(const std::vector<ImageU8>& pictures,
                                const std::vector<ImageU8>& truths, double flat_share) {
  ColorFitter fitter;
  for (size_t i = 0; i < pictures.size(); ++i) {
    LITAGS_RETURN_IF_ERROR(fitter.Add(truths[i], pictures[i]));
  }
  LITAGS_ASSIGN_OR_RETURN(const ColorFit fit, fitter.Fit());
  Quality mean;
  const auto n = static_cast<double>(pictures.size());
  for (size_t i = 0; i < pictures.size(); ++i) {
    const Planes truth = ToPlanes(truths[i]);
    LITAGS_ASSIGN_OR_RETURN(const double noise, FlatNoise(ToPlanes(pictures[i]), fit.Apply(truth),
                                                          FlatPixels(truth, flat_share)));
    LITAGS_ASSIGN_OR_RETURN(const double ssim, Ssim(pictures[i], truths[i]));
    LITAGS_ASSIGN_OR_RETURN(const double psnr, Psnr(pictures[i], truths[i]));
    mean.noise += noise / n;
    mean.ssim += ssim / n;
    mean.psnr += psnr / n;
  }
  return mean;
}

nlohmann::json JsonOf(const Quality& q) {
  return {{"noise", q.noise}, {"ssim", q.ssim}, {"psnr", q.psnr}};
}

void Print(const char* what, const Quality& q) {
  std::printf("%-8s noise %.4f  SSIM %.4f  PSNR %.2f dB\n", what, q.noise, q.ssim, q.psnr);
}

absl::Status MeasureNoise(const NoiseArguments& args) {
  LITAGS_ASSIGN_OR_RETURN(const Pictures p, ReadPictures(args));
  ReconstructOptions as_taken;  // brightened, with all of their noise
  as_taken.recipe = Litags();
  as_taken.recipe->tone.chroma_smoothing = 0;
  LITAGS_ASSIGN_OR_RETURN(const std::vector<ImageU8> targets,
                          MakePseudoTargets(p.photos, as_taken));
  LITAGS_ASSIGN_OR_RETURN(const Quality photo, Measure(targets, p.truths, args.flat_share));
  LITAGS_ASSIGN_OR_RETURN(const Quality render, Measure(p.renders, p.truths, args.flat_share));
  Print("photos", photo);
  Print("renders", render);
  std::printf("renders have %.3f of the photos' noise in the flattest %.0f %% of %d views\n",
              render.noise / photo.noise, 100 * args.flat_share,
              static_cast<int>(p.renders.size()));
  nlohmann::json json = {{"photos", JsonOf(photo)},
                         {"renders", JsonOf(render)},
                         {"ratio", render.noise / photo.noise},
                         {"views", p.renders.size()}};
  if (!args.again.empty()) {
    LITAGS_ASSIGN_OR_RETURN(const double noise, NoiseOfTwo(p, args.flat_share));
    std::printf("of it %.4f, %.3f of the photos', follows the photos' noise\n", noise,
                noise / photo.noise);
    json["noise_of_photos"] = noise;
    json["ratio_of_photos"] = noise / photo.noise;
  }
  return WriteJson(args.json, JsonText(json, 2));
}

}  // namespace

void AddNoiseCommand(CLI::App* app, int* exit_status) {
  auto args = std::make_shared<NoiseArguments>();
  CLI::App* command = app->add_subcommand(
      "noise", "Noise of renders against that of the brightened photos of the same test views");
  AddSceneOptions(command, "SCENE whose high/ has no noise: litags-sample's", &args->scene)
      ->check(CLI::ExistingDirectory);
  command->add_option("pictures", args->pictures, "folder of renders of its test views")
      ->required()
      ->check(CLI::ExistingDirectory);
  command
      ->add_option("--again", args->again,
                   "renders of a scene trained on the same photos with other noise "
                   "(litags-sample --noise-seed): tells noise from detail that is missing")
      ->check(CLI::ExistingDirectory);
  command->add_option("--flat", args->flat_share, "share of the pixels that count as flat")
      ->check(Between(0.01, 1.0))
      ->capture_default_str();
  AddJsonOption(command, &args->json);
  WhenGiven(command, exit_status, [args] { return MeasureNoise(*args); });
}

}  // namespace litags
