#include "engine/train/trainer.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <numeric>
#include <utility>

#include "absl/strings/str_cat.h"
#include "engine/core/check.h"
#include "engine/core/error.h"
#include "engine/core/rng.h"
#include "engine/render/renderer.h"
#include "engine/train/adam.h"
#include "engine/train/objective.h"
#include "engine/train/pyramid.h"
#include "engine/train/train_state.h"

namespace litags {
namespace {

constexpr uint64_t kViewOrderStream = 0x5649;  // random numbers of the photos' order

// Adds the time until its destruction to a total.
class Timer {
 public:
  explicit Timer(double* total) : total_(total), start_(std::chrono::steady_clock::now()) {}
  ~Timer() {
    *total_ += std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
  }

 private:
  double* total_;
  std::chrono::steady_clock::time_point start_;
};

// Photos in a new random order every epoch: a Fisher-Yates shuffle keyed by the epoch.
size_t ViewOfIteration(uint64_t seed, int iteration, size_t views) {
  const uint64_t epoch = iteration / views;
  const CounterRng rng(seed, kViewOrderStream + (epoch << 16));
  std::vector<uint32_t> order(views);
  std::iota(order.begin(), order.end(), 0);
  for (size_t i = views - 1; i > 0; --i) std::swap(order[i], order[rng.Below(i, i + 1)]);
  return order[iteration % views];
}

absl::Status NotFinite(const StepLosses& losses, int iteration, const std::string& view) {
  const std::pair<const char*, double> terms[] = {{"exposure", losses.exposure},
                                                  {"reconstruction", losses.reconstruction},
                                                  {"prior", losses.prior},
                                                  {"depth", losses.depth},
                                                  {"denoise", losses.denoise}};
  for (const auto& [name, value] : terms) {
    if (std::isfinite(value)) continue;
    return MakeError(absl::StatusCode::kInternal, "NOT_FINITE", name,
                     absl::StrCat("the ", name, " loss became ", value, " at iteration ", iteration,
                                  " (photo ", view, ")"));
  }
  return absl::OkStatus();
}

}  // namespace

struct Trainer::Impl {
  Impl(const TrainOptions& o, const std::vector<TrainView>* v, double scene_extent)
      : options(o), pyramid(v, o), num_views(v->size()), extent(scene_extent), objective(o) {}

  int ShDegree() const {
    const int grown = 1 + state.iteration / options.sh_interval;
    return std::min(options.sh_degree, grown);
  }

  int DensifyUntil() const {
    return std::min(pyramid.CoarseEnd() + options.densify_until, options.iterations / 2);
  }

  AdamStep MakeAdamStep(int sh_degree) const {
    AdamStep step(state.iteration + 1, AdamConstants());
    const double progress = std::min(1.0, double(state.iteration) / options.iterations);
    // Log-linear from lr_means to lr_means_final, either of which may be 0.
    const double ratio = options.lr_means > 0 ? options.lr_means_final / options.lr_means : 0;
    const double lr_means = options.lr_means * std::pow(ratio, progress) * extent;
    const auto set = [&](int row, int count, double lr) {
      std::fill_n(step.lr.begin() + row, count, static_cast<float>(lr));
    };
    set(kMean, 3, lr_means);
    set(kLogScale, 3, options.lr_scales);
    set(kRawQuat, 4, options.lr_quats);
    set(kLogitOpacity, 1, options.lr_opacity);
    set(kShDc, 3, options.lr_sh_dc);
    set(kDepth, kShRest - kDepth, options.lr_attributes);
    set(kShRest, kSplatRows - kShRest, options.lr_sh_rest);
    step.rows = SplatRowsForDegree(sh_degree);
    return step;
  }

  void UpdatePdm(const AdamStep& step) {
    for (size_t k = 0; k < state.pdm.nets.size(); ++k) {
      AdamUpdate(step, static_cast<float>(options.lr_pdm), v_pdm.nets[k],
                 absl::MakeSpan(state.pdm.nets[k]), absl::MakeSpan(state.pdm_moment1.nets[k]),
                 absl::MakeSpan(state.pdm_moment2.nets[k]));
    }
  }

  void Densify() {
    const int done = state.iteration;
    if (done < options.densify_start || done > DensifyUntil() ||
        done % options.densify_every != 0) {
      return;
    }
    Timer timer(&phases.density);
    // Smaller photos have fewer pixels to explain; more Gaussians would only learn their noise.
    TrainOptions limited = options;
    limited.max_gaussians >>= 2 * pyramid.LevelOf(done);
    ControlDensity(limited, extent, done, &state.splats, &state.density);
  }

  TrainOptions options;
  ViewPyramid pyramid;
  size_t num_views;
  double extent;
  TrainState state;
  Objective objective;
  Renderer renderer;
  Planes rendered, alpha, v_rendered;
  PdmWeights v_pdm;
  PhaseSeconds phases;
};

Trainer::Trainer(const TrainOptions& options, const std::vector<TrainView>* views, Splats initial,
                 double extent)
    : impl_(std::make_unique<Impl>(options, views, extent)) {
  LITAGS_CHECK(!views->empty());
  TrainState& s = impl_->state;
  s.splats.params = std::move(initial);
  s.splats.moment1 = Splats(s.splats.params.size());
  s.splats.moment2 = Splats(s.splats.params.size());
  s.splats.Rearrange(MortonOrder(s.splats.params));
  s.density.Reset(s.splats.params.size());
  if (options.lita && options.use_pdm) {
    s.pdm = PdmWeights::Initial(options.pdm, options.seed);
    s.pdm_moment1 = PdmWeights::Zeros(options.pdm);
    s.pdm_moment2 = PdmWeights::Zeros(options.pdm);
  }
}

Trainer::~Trainer() = default;

int Trainer::iteration() const { return impl_->state.iteration; }
size_t Trainer::num_gaussians() const { return impl_->state.splats.params.size(); }
const PhaseSeconds& Trainer::phases() const { return impl_->phases; }

double Trainer::WorkBefore(int iteration) const { return impl_->pyramid.WorkBefore(iteration); }

absl::StatusOr<StepLosses> Trainer::Step() {
  Impl& s = *impl_;
  const int level = s.pyramid.LevelOf(s.state.iteration);
  const TrainView& view =
      s.pyramid.View(level, ViewOfIteration(s.options.seed, s.state.iteration, s.num_views));
  const bool denoise = level == 0 && s.objective.Denoises(s.state.iteration);
  const Camera& camera = view.view.camera;
  RenderSettings settings;
  settings.num_channels = s.options.lita ? int{kNumChannels} : 3;
  settings.sh_degree = s.ShDegree();
  settings.threads = s.options.threads;
  {
    Timer timer(&s.phases.forward);
    s.renderer.Forward(s.state.splats.params, camera, settings, &s.rendered, &s.alpha);
  }
  StepLosses losses;
  {
    Timer timer(&s.phases.losses);
    losses = s.objective.Evaluate(view, s.rendered, s.state.pdm, s.state.iteration, denoise,
                                  &s.v_rendered, &s.v_pdm);
  }
  LITAGS_RETURN_IF_ERROR(NotFinite(losses, s.state.iteration, view.view.name));
  {
    Timer timer(&s.phases.backward);
    const AdamStep step = s.MakeAdamStep(settings.sh_degree);
    s.renderer.Backward(s.state.splats.params, s.v_rendered, Planes(),
                        [&](size_t block, const float* grads, uint32_t visible) {
                          AdamUpdateBlock(step, grads, visible, block, &s.state.splats.params,
                                          &s.state.splats.moment1, &s.state.splats.moment2);
                        });
    if (denoise) s.UpdatePdm(step);
  }
  ++s.state.iteration;
  if (s.state.iteration <= s.DensifyUntil()) {
    s.state.density.Add(s.renderer.stats(), camera.width, camera.height);
    s.Densify();
  }
  s.phases.denoise = s.objective.denoise_seconds();
  return losses;
}

Model Trainer::Snapshot() const {
  const Impl& s = *impl_;
  Model model;
  model.splats = s.state.splats.params;
  model.lita = s.options.lita;
  model.use_pdm = s.options.lita && s.options.use_pdm;
  model.pdm_options = s.options.pdm;
  model.pdm = s.state.pdm;
  model.sh_degree = s.ShDegree();
  model.iteration = s.state.iteration;
  return model;
}

absl::Status Trainer::SaveCheckpoint(const std::string& path,
                                     const std::string& fingerprint) const {
  return SaveTrainState(path, fingerprint, impl_->state);
}

absl::Status Trainer::LoadCheckpoint(const std::string& path, const std::string& fingerprint) {
  LITAGS_ASSIGN_OR_RETURN(TrainState state, LoadTrainState(path, fingerprint));
  if (state.pdm.nets.size() != impl_->state.pdm.nets.size() ||
      state.pdm.hidden != impl_->state.pdm.hidden) {
    return MakeError(
        absl::StatusCode::kDataLoss, "CHECKPOINT_INCONSISTENT", "checkpoint",
        "checkpoint: the denoiser has another shape; delete the checkpoint to start again");
  }
  impl_->state = std::move(state);
  return absl::OkStatus();
}

}  // namespace litags
