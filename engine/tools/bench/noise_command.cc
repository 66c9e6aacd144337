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
#include "engine/eval/metrics.h"
#include "engine/eval/noise.h"
#include "engine/io/file_util.h"
#include "engine/io/image_io.h"
#include "engine/tools/bench/commands.h"
#include "engine/tools/evaluation/benchmark_scene.h"

namespace litags {
namespace {

struct NoiseArguments {
  BenchmarkScene scene;
  std::string pictures, json;
  FlatNoiseOptions flat;
};

// Means over the views.
struct Quality {
  double noise = 0, ssim = 0, psnr = 0;
};

// Of pictures of one origin. The truth is brought to their tone by one affine colour map for all
// views (in this direction: the truth has no noise that would flatten the fit), so that contrast
// left in a flat area is not taken for noise.
absl::StatusOr<Quality> Measure(const std::vector<ImageU8>& pictures,
                                const std::vector<ImageU8>& truths,
                                const FlatNoiseOptions& options) {
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
                                                          FlatPixels(truth, options), options));
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
  LITAGS_ASSIGN_OR_RETURN(const std::vector<TestView> views, args.scene.TestViews());
  std::vector<ImageU8> renders, photos, truths;
  for (const TestView& view : views) {
    const absl::StatusOr<std::string> render = FindPhoto(args.pictures, view.view.name);
    if (absl::IsNotFound(render.status())) continue;
    LITAGS_RETURN_IF_ERROR(render.status());
    LITAGS_ASSIGN_OR_RETURN(ImageU8 picture, ReadImage(*render, *render));
    LITAGS_ASSIGN_OR_RETURN(ImageU8 photo, LoadPhoto(args.scene.PhotosDir(), view));
    LITAGS_ASSIGN_OR_RETURN(ImageU8 truth, LoadPhoto(args.scene.TruthDir(), view));
    renders.push_back(std::move(picture));
    photos.push_back(std::move(photo));
    truths.push_back(std::move(truth));
  }
  if (renders.empty()) {
    return MakeError(
        absl::StatusCode::kNotFound, "NO_PICTURES", "pictures",
        absl::StrCat(args.pictures, " has no picture named as a test view of ", args.scene.dir));
  }
  ReconstructOptions as_taken;  // brightened, with all of their noise
  as_taken.chroma_smoothing = 0;
  LITAGS_ASSIGN_OR_RETURN(const std::vector<ImageU8> targets, MakePseudoTargets(photos, as_taken));
  LITAGS_ASSIGN_OR_RETURN(const Quality photo, Measure(targets, truths, args.flat));
  LITAGS_ASSIGN_OR_RETURN(const Quality render, Measure(renders, truths, args.flat));
  Print("photos", photo);
  Print("renders", render);
  std::printf("renders have %.3f of the photos' noise in the flattest %.0f %% of %d views\n",
              render.noise / photo.noise, 100 * args.flat.share, static_cast<int>(renders.size()));
  if (args.json.empty()) return absl::OkStatus();
  const nlohmann::json json = {{"photos", JsonOf(photo)},
                               {"renders", JsonOf(render)},
                               {"ratio", render.noise / photo.noise},
                               {"views", renders.size()}};
  return WriteFileAtomically(args.json, json.dump(2) + "\n");
}

}  // namespace

void AddNoiseCommand(CLI::App* app, int* exit_status) {
  auto args = std::make_shared<NoiseArguments>();
  args->scene.light = "low";
  CLI::App* command = app->add_subcommand(
      "noise", "Noise of renders against that of the brightened photos of the same test views");
  command->add_option("scene", args->scene.dir, "SCENE whose high/ has no noise: litags-sample's")
      ->required()
      ->check(CLI::ExistingDirectory);
  command->add_option("pictures", args->pictures, "folder of renders of its test views")
      ->required()
      ->check(CLI::ExistingDirectory);
  command->add_option("--light", args->scene.light, "photos are in SCENE/LIGHT")
      ->capture_default_str();
  command->add_option("--flat", args->flat.share, "share of the pixels that count as flat")
      ->check(CLI::Range(0.01, 1.0))
      ->capture_default_str();
  command->add_option("--json", args->json, "also write the figures here");
  command->callback([args, exit_status] {
    if (const absl::Status s = MeasureNoise(*args); !s.ok()) {
      std::fprintf(stderr, "litags-bench: %s\n", std::string(s.message()).c_str());
      *exit_status = 1;
    }
  });
}

}  // namespace litags
