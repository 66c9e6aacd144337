// litags-bench render: latency of finished pictures.
#include <algorithm>
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
#include "engine/pipeline/scene_file.h"
#include "engine/render/renderer.h"
#include "engine/tools/bench/bench_scene.h"
#include "engine/tools/bench/command_options.h"
#include "engine/tools/bench/commands.h"
#include "engine/tools/bench/timing.h"
#include "engine/tools/bench/timing_options.h"
#include "engine/train/model.h"
#include "engine/train/recipe.h"
#include "proto/arguments/arguments.h"

namespace litags {
namespace {

struct RenderArguments {
  int gaussians = 100000, frames = 60, threads = 0, width = 500, height = 375;
  std::string json, save;
};

// A row of cameras, as of photos taken on a step aside.
std::vector<View> BenchViews(const RenderArguments& args) {
  std::vector<View> views;
  for (int i = 0; i < 9; ++i) {
    View& view = views.emplace_back();
    view.name = absl::StrCat("view", i, ".png");
    view.camera = BenchCamera(args.width, args.height);
    view.camera.t[0] = 0.1 * (i - 4);
  }
  return views;
}

// Milliseconds of each frame, sorted. The camera moves, as along a path.
template <class Body>
std::vector<double> Latencies(const RenderArguments& args, Body body) {
  Camera camera = BenchCamera(args.width, args.height);
  std::vector<double> ms;
  for (int i = -3; i < args.frames; ++i) {  // three to warm up
    camera.t[0] = 0.003 * i;
    const double start = NowMs();
    body(camera);
    if (i >= 0) ms.push_back(NowMs() - start);
  }
  std::sort(ms.begin(), ms.end());
  return ms;
}

nlohmann::json Report(const char* name, const std::vector<double>& ms) {
  const double p50 = ms[ms.size() / 2], p99 = ms[ms.size() * 99 / 100];
  std::printf("%-22s p50 %7.2f ms  p99 %7.2f ms  %.1f frames/s\n", name, p50, p99, 1e3 / p50);
  return {{"p50_ms", p50}, {"p99_ms", p99}, {"frames_per_second", 1e3 / p50}};
}

absl::Status Run(const RenderArguments& args) {
  Model model;
  model.splats = BenchSplats(args.gaussians, BenchCamera(args.width, args.height));
  model.pdm_options = Litags().pdm;
  model.pdm = PdmWeights::Initial(model.pdm_options, 1);
  model.noise = BenchNoise();
  model.pixel_filter = PixelFilter::kMip;
  nlohmann::json json = {
      {"gaussians", args.gaussians}, {"width", args.width}, {"height", args.height}};

  Renderer renderer;
  Planes image, alpha;
  RenderSettings settings;
  settings.threads = args.threads;
  settings.pixel_filter = model.pixel_filter;
  for (const auto& [name, channels] :
       {std::pair{"colour", 3}, {"all channels", int{kNumChannels}}}) {
    settings.num_channels = channels;
    json[channels == 3 ? "color" : "channels"] =
        Report(name, Latencies(args, [&](const Camera& camera) {
                 renderer.Forward(model.splats, camera, settings, &image, &alpha);
               }));
  }
  ModelRenderer finished(args.threads);
  Planes color;
  for (const bool use_pdm : {false, true}) {
    model.use_pdm = use_pdm;
    json[use_pdm ? "finished_pdm" : "finished"] = Report(
        use_pdm ? "with the denoiser" : "finished", Latencies(args, [&](const Camera& camera) {
          finished.RenderColor(model, camera, &color);
        }));
  }
  model.use_pdm = false;
  if (!args.save.empty()) {
    LITAGS_RETURN_IF_ERROR(SaveScene(args.save, model, BenchViews(args)));
  }
  return WriteJson(args.json, JsonText(json, 2));
}

}  // namespace

void AddRenderCommand(CLI::App* app, int* exit_status) {
  auto args = std::make_shared<RenderArguments>();
  CLI::App* command =
      app->add_subcommand("render", "Measures the latency of pictures of a made-up scene");
  AddGaussiansOption(command, &args->gaussians);
  AddSizeOption(command, &args->width, &args->height);
  command->add_option("--frames", args->frames)->capture_default_str()->check(Between(1, 100000));
  AddThreadsOption(command, &args->threads);
  AddJsonOption(command, &args->json);
  command->add_option("--save", args->save, "also write the scene here, as a job has it");
  WhenGiven(command, exit_status, [args] { return Run(*args); });
}

}  // namespace litags
