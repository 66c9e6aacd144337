// litags-bench kernels: time of every part of a training iteration on a made-up scene.
#include <algorithm>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>

#include "CLI/App.hpp"
#include "CLI/Config.hpp"
#include "CLI/Formatter.hpp"
#include "absl/strings/str_cat.h"
#include "engine/core/json_text.h"
#include "engine/core/parallel.h"
#include "engine/core/simd_target.h"
#include "engine/render/binning.h"
#include "engine/render/projection.h"
#include "engine/render/renderer.h"
#include "engine/tools/bench/bench_scene.h"
#include "engine/tools/bench/command_options.h"
#include "engine/tools/bench/commands.h"
#include "engine/tools/bench/machine.h"
#include "engine/tools/bench/roofline.h"
#include "engine/tools/bench/timing.h"
#include "engine/tools/bench/timing_options.h"
#include "engine/tools/evaluation/process_usage.h"
#include "engine/train/adam.h"
#include "engine/train/model.h"
#include "engine/train/objective.h"
#include "engine/train/recipe.h"
#include "engine/train/trainer.h"
#include "proto/arguments/arguments.h"

namespace litags {
namespace {

struct KernelArguments {
  TimingOptions timing;
  int threads = 0, pdm_hidden = 0;
  std::string json;
};

class KernelBench {
 public:
  explicit KernelBench(const KernelArguments& args)
      : args_(args),
        camera_(BenchCamera(args.timing.width, args.timing.height)),
        splats_(BenchSplats(args.timing.gaussians, camera_)),
        views_{BenchView(camera_)} {
    options_.recipe = WithPdm(Litags());
    if (args.pdm_hidden > 0) options_.recipe.pdm.hidden = args.pdm_hidden;
    options_.threads = args.threads;
    options_.iterations = 1000000;  // density control stays out of the way
    options_.recipe.densify_until = 0;
    // Every step is a full one.
    options_.recipe.coarse_levels = 0;
    options_.recipe.pdm_every = 1;
    settings_.threads = args.threads;
    settings_.pixel_filter = PixelFilter::kMip;
  }

  void Run() {
    const int threads = args_.threads > 0 ? args_.threads : DefaultThreadCount();
    peaks_ = {PeakGflops(threads), TriadGbytes(threads)};
    std::printf("%s, %d threads: at most %.1f GFLOP/s, %.1f GB/s\n", SimdTarget(), threads,
                peaks_.gflops, peaks_.gbytes_per_second);
    json_["peaks"] = {{"gflops", peaks_.gflops}, {"gbytes_per_second", peaks_.gbytes_per_second}};
    CountEvaluations();
    const double forward = TimeRendering(kWithoutNoise, "_8");  // training without the denoiser
    TimePartsOfForward(forward);
    TimeRendering(kNumChannels, "");
    TimeObjective();
    TimeAdam();
    TimeWhole();
    json_["gaussians"] = args_.timing.gaussians;
    json_["width"] = camera_.width;
    json_["height"] = camera_.height;
    json_["threads"] = threads;
    json_["peak_rss_bytes"] = PeakRssBytes();
  }

  const nlohmann::json& json() const { return json_; }

 private:
  void Report(const std::string& name, const Timing& t, const std::string& what) {
    std::printf("%-13s %8.2f ms  (%.2f .. %.2f)  %s\n", name.c_str(), t.median_ms, t.min_ms,
                t.max_ms, what.c_str());
    json_[name + "_ms"] = t.median_ms;
    json_["spread"][name + "_ms"] = {t.min_ms, t.max_ms};
  }

  void ReportRoofline(const std::string& name, double ms, const Work& work) {
    const double least = peaks_.LeastMilliseconds(work);
    std::printf("  at least %.2f ms at the machine's peak: %.0f %% of it reached\n", least,
                100 * least / ms);
    json_["roofline"][name] = {{"least_ms", least}, {"fraction", least / ms}};
  }

  void CountEvaluations() {
    Planes alpha;
    renderer_.Forward(splats_, camera_, settings_, &rendered_, &alpha);
    const Renderer::Counters c = renderer_.counters();
    const double per_pixel = c.evaluations / (double(camera_.width) * camera_.height);
    std::printf("%.1f evaluations of alpha per pixel; %.2f tiles per visible Gaussian\n", per_pixel,
                double(c.tile_pairs) / c.visible);
    json_["evaluations_per_pixel"] = per_pixel;
  }

  // Returns the milliseconds of forward.
  double TimeRendering(int channels, const std::string& suffix) {
    settings_.num_channels = channels;
    Planes alpha;
    const auto forward = [&] {
      renderer_.Forward(splats_, camera_, settings_, &rendered_, &alpha);
    };
    const Timing t = Measure(args_.timing.repetitions, forward);
    Report("forward" + suffix, t,
           absl::StrCat("project, sort, bin, composite ", channels, " channels"));
    const Renderer::Counters c = renderer_.counters();
    const double nanoseconds = 1e6 * t.median_ms / c.evaluations;
    std::printf("  %.2f ns an evaluation of alpha\n", nanoseconds);
    ReportRoofline("forward" + suffix, t.median_ms, ForwardWork(c.evaluations, channels));
    json_["forward" + suffix + "_ns_per_evaluation"] = nanoseconds;

    Planes v(channels, camera_.height, camera_.width);
    for (size_t i = 0; i < v.data.size(); ++i) v.data[i] = 1e-6f * (i % 17);
    const Timing backward = Measure(args_.timing.repetitions, [&] {
      renderer_.Backward(splats_, v, Planes(), [](size_t, const float*, uint32_t) {});
    });
    Report("backward" + suffix, backward, "compositing and projection, no parameter update");
    ReportRoofline("backward" + suffix, backward.median_ms, BackwardWork(c.evaluations, channels));
    return t.median_ms;
  }

  // Of 8 channels. Compositing is what is left of `forward_ms`.
  void TimePartsOfForward(double forward_ms) {
    const int threads = args_.threads > 0 ? args_.threads : DefaultThreadCount();
    ProjectedSplats projected;
    projected.Resize(splats_.size(), kWithoutNoise);
    const KernelCamera camera(camera_);
    RenderSettings settings = settings_;
    settings.num_channels = kWithoutNoise;
    const size_t blocks = splats_.num_blocks();
    const Timing projection = Measure(args_.timing.repetitions, [&] {
      ParallelFor(threads, (blocks + 31) / 32, [&](size_t task, int) {
        const size_t end = std::min(32 * (task + 1), blocks);
        for (size_t b = 32 * task; b < end; ++b) {
          ProjectBlock(splats_, b, camera, settings, &projected);
        }
      });
    });
    Report("projection", projection, "part of forward: ellipses and colours of Gaussians");

    TileLists lists;
    BinScratch scratch;
    const Timing binning = Measure(args_.timing.repetitions, [&] {
      Bin(projected, AllTiles(camera_.width, camera_.height), threads, &lists, &scratch);
    });
    Report("binning", binning, "part of forward: depth sort and tile lists");

    const double rest = forward_ms - projection.median_ms - binning.median_ms;
    std::printf("%-13s %8.2f ms  the rest of forward\n", "compositing", rest);
    json_["compositing_ms"] = rest;
    ReportRoofline("compositing", rest,
                   ForwardWork(renderer_.counters().evaluations, kWithoutNoise));
  }

  void TimeObjective() {
    PdmWeights weights = PdmWeights::Initial(options_.recipe.pdm, 1), v_weights;
    Planes v_rendered;
    TrainOptions without = options_;
    without.recipe.use_pdm = false;
    Objective plain(without), full(options_);
    Planes few(plain.NumChannels(), rendered_.height, rendered_.width);
    std::copy_n(rendered_.data.begin(), few.data.size(), few.data.begin());
    const Timing loss = Measure(args_.timing.repetitions, [&] {
      plain.Evaluate(views_[0], few, weights, 0, false, &v_rendered, &v_weights);
    });
    Report("loss", loss, "all losses and their gradients but the denoiser's");
    ReportRoofline("loss", loss.median_ms, LossWork(double(camera_.width) * camera_.height));
    const Timing both = Measure(args_.timing.repetitions, [&] {
      full.Evaluate(views_[0], rendered_, weights, 0, true, &v_rendered, &v_weights);
    });
    Report("objective", both, "losses and denoiser");
    const PlanesView color(rendered_, kChannelColor, 3), noise(rendered_, kChannelNoise, 3);
    Planes v_r0(3, rendered_.height, rendered_.width), v_noise = v_r0;
    Pdm pdm(options_.recipe.pdm, options_.threads);
    const Timing denoiser = Measure(args_.timing.repetitions, [&] {
      pdm.Forward(weights, color, noise);
      pdm.Backward(color, noise, v_r0, v_noise, &v_weights);
    });
    Report("pdm", denoiser, "denoiser, forward and backward");
    ReportRoofline(
        "pdm", denoiser.median_ms,
        DenoiserWork(color.plane_size(), options_.recipe.pdm.hidden, options_.recipe.pdm.stages));
  }

  void TimeAdam() {
    Splats params = splats_, m1(splats_.size()), m2(splats_.size());
    const AdamStep step(10, AdamConstants());
    const Timing t = Measure(args_.timing.repetitions, [&] {
      ParallelFor(args_.threads, (params.num_blocks() + 31) / 32, [&](size_t task, int) {
        const size_t end = std::min(32 * (task + 1), params.num_blocks());
        for (size_t b = 32 * task; b < end; ++b) {
          AdamUpdateBlock(step, splats_.block(b), 0xFFFF, b, &params, &m1, &m2);
        }
      });
    });
    Report("adam", t, "all Gaussians, all 67 rows (in training fused with backward)");
    ReportRoofline("adam", t.median_ms, AdamWork(splats_.size(), kSplatRows));
  }

  void TimeWhole() {
    // SH degree 3 is what most iterations run at.
    options_.recipe.sh_interval = 1;
    TrainOptions without = options_;
    without.recipe.use_pdm = false;
    Trainer plain(without, &views_, splats_, 1.0), denoising(options_, &views_, splats_, 1.0);
    Report("iteration_8", Measure(args_.timing.repetitions, [&] { (void)plain.Step(); }),
           "one full training step, without the denoiser and its channels");
    Report("iteration", Measure(args_.timing.repetitions, [&] { (void)denoising.Step(); }),
           "one full training step, denoiser included");
    Model model = denoising.Snapshot();
    model.noise = BenchNoise();
    ModelRenderer renderer(args_.threads);
    Planes color;
    const auto time_render = [&](const char* name, const char* what) {
      Report(
          name,
          Measure(args_.timing.repetitions, [&] { renderer.RenderColor(model, camera_, &color); }),
          what);
    };
    time_render("render_pdm", "a picture with the denoiser: colour and noise, denoised, filtered");
    model.use_pdm = false;
    time_render("render", "a finished picture: colour, filtered");
  }

  KernelArguments args_;
  Camera camera_;
  Splats splats_;
  std::vector<TrainView> views_;
  TrainOptions options_;
  RenderSettings settings_;
  Renderer renderer_;
  Peaks peaks_;
  Planes rendered_;
  nlohmann::json json_;
};

}  // namespace

void AddKernelsCommand(CLI::App* app, int* exit_status) {
  auto args = std::make_shared<KernelArguments>();
  CLI::App* command = app->add_subcommand("kernels", "Times every part of a training iteration");
  AddTimingOptions(command, &args->timing);
  AddThreadsOption(command, &args->threads);
  command->add_option("--pdm-hidden", args->pdm_hidden, "channels of the denoiser; 0: the default")
      ->check(Between(0, 64));
  AddJsonOption(command, &args->json);
  WhenGiven(command, exit_status, [args] {
    KernelBench bench(*args);
    bench.Run();
    return WriteJson(args->json, JsonText(bench.json(), 2));
  });
}

}  // namespace litags
