#include "engine/train/trainer.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "absl/strings/str_cat.h"
#include "engine/core/check.h"
#include "engine/core/error.h"
#include "engine/core/monotonic_seconds.h"
#include "engine/core/rng.h"
#include "engine/render/renderer.h"
#include "engine/train/adam.h"
#include "engine/train/crop.h"
#include "engine/train/density_schedule.h"
#include "engine/train/objective.h"
#include "engine/train/pyramid.h"
#include "engine/train/train_state.h"

namespace litags {
namespace {

constexpr uint64_t kViewOrderStream = 0x5649;  // random numbers of the photos' order
constexpr uint64_t kDropoutStream = 0x4450;    // and of who is left out
constexpr double kDropoutEpochs = 50;          // at full size, to half of recipe.dropout. Choice

constexpr int kSkipsOfAPhoto = 2;  // then it is left out: it will not get better

// Photos in a new random order every epoch.
size_t ViewOfIteration(uint64_t seed, int iteration, size_t views) {
  const uint64_t epoch = iteration / views;
  return Shuffled(seed, kViewOrderStream + (epoch << 16), views, iteration % views);
}

// The first loss that is not finite, or null.
const char* NotFinite(const StepLosses& losses) {
  const std::pair<const char*, double> terms[] = {{"exposure", losses.exposure},
                                                  {"reconstruction", losses.reconstruction},
                                                  {"prior", losses.prior},
                                                  {"depth", losses.depth},
                                                  {"denoise", losses.denoise}};
  for (const auto& [name, value] : terms) {
    if (!std::isfinite(value)) return name;
  }
  return nullptr;
}

std::vector<std::array<double, 3>> CentersOf(const std::vector<TrainView>& views) {
  std::vector<std::array<double, 3>> centers;
  for (const TrainView& view : views) centers.push_back(view.view.camera.Center());
  return centers;
}

absl::Status NotFiniteError(const std::string& field, const std::string& message) {
  return MakeError(absl::StatusCode::kInternal, "NOT_FINITE", field, message);
}

}  // namespace

struct Trainer::Impl {
  Impl(const TrainOptions& o, const std::vector<TrainView>* v, double scene_extent)
      : options(o),
        pyramid(v, o),
        num_views(v->size()),
        extent(scene_extent),
        density(o, CentersOf(*v), scene_extent, pyramid.CoarseEnd()),
        objective(o) {
    for (const TrainView& view : *v) given_poses.emplace_back(view.view.camera);
  }

  // Those beyond the schedule go on as it ended.
  int ScheduledIteration() const { return std::min(state.iteration, options.iterations); }

  // At full size.
  double Epochs() const {
    return std::max(0, ScheduledIteration() - pyramid.CoarseEnd()) / static_cast<double>(num_views);
  }

  double RateDecay() const {
    if (options.recipe.lr_decay_epochs == 0) return 1;
    return 1 / (1 + Epochs() / options.recipe.lr_decay_epochs);
  }

  // A rate that falls over the run.
  double Falling(double first, double last) const {
    return FallingRate(first, last, double(ScheduledIteration()) / options.iterations);
  }

  Dropout MakeDropout() const {
    const double share = options.recipe.dropout * Epochs() / (Epochs() + kDropoutEpochs);
    return {share, CounterRng(options.seed, kDropoutStream + (uint64_t(state.iteration) << 16))};
  }

  AdamStep MakeAdamStep(int sh_degree) const {
    AdamStep step(state.iteration + 1, AdamConstants());
    const double lr_means =
        Falling(options.recipe.lr_means, options.recipe.lr_means_final) * extent;
    const auto set = [&](int row, int count, double lr) {
      std::fill_n(step.lr.begin() + row, count, static_cast<float>(lr));
    };
    set(kMean, 3, lr_means);
    set(kLogScale, 3, options.recipe.lr_scales);
    set(kRawQuat, 4, options.recipe.lr_quats);
    set(kLogitOpacity, 1, options.recipe.lr_opacity);
    set(kShDc, 3, options.recipe.lr_sh_dc);
    set(kDepth, kShRest - kDepth, options.recipe.lr_attributes);
    set(kShRest, kSplatRows - kShRest, options.recipe.lr_sh_rest);
    const auto decay = static_cast<float>(RateDecay());
    for (int row = kMean + 3; row < kSplatRows; ++row) step.lr[row] *= decay;
    step.rows = SplatRowsForDegree(sh_degree);
    return step;
  }

  // The number of the PDM's step in this iteration, from 1: it learns in some of those at full
  // size.
  int PdmStep() const {
    const int every = options.recipe.pdm_every, first = pyramid.CoarseEnd();
    return state.iteration / every - (first + every - 1) / every + 1;
  }

  // False if a weight or moment is no longer finite.
  bool UpdatePdm() {
    const AdamStep step(PdmStep(), AdamConstants());
    bool finite = true;
    for (size_t k = 0; k < state.pdm.nets.size(); ++k) {
      finite &=
          AdamUpdate(step, static_cast<float>(options.recipe.lr_pdm), v_pdm.nets[k],
                     absl::MakeSpan(state.pdm.nets[k]), absl::MakeSpan(state.pdm_moment1.nets[k]),
                     absl::MakeSpan(state.pdm_moment2.nets[k]));
    }
    return finite;
  }

  // The Gaussians' update from the renderer's gradients. The smallest index of those that are no
  // longer finite, if any; none if this iteration recovers from them.
  std::optional<size_t> UpdateSplats(const AdamStep& step) {
    const bool hide = RecoversHere(/*gaussians=*/true);
    SmallestIndex lost;
    renderer.Backward(state.splats.params, v_rendered, Planes(),
                      [&](size_t block, const float* grads, uint32_t visible) {
                        if (hide)
                          return UpdateBlockOrHide(step, grads, visible, block, &state.splats);
                        const uint32_t bad =
                            AdamUpdateBlock(step, grads, visible, block, &state.splats.params,
                                            &state.splats.moment1, &state.splats.moment2);
                        if (bad != 0) lost.Add(block * kSplatBlock + std::countr_zero(bad));
                      });
    return lost.any() ? std::optional(lost.get()) : std::nullopt;
  }

  bool RecoversHere(bool gaussians) const {
    return std::any_of(state.nan_recoveries.begin(), state.nan_recoveries.end(),
                       [&](const NanRecovery& d) {
                         return d.iteration == state.iteration && d.gaussians == gaussians;
                       });
  }

  // How often a photo's turn was skipped before `iteration`.
  int Skips(size_t photo, int iteration) const {
    return static_cast<int>(std::count_if(
        state.nan_recoveries.begin(), state.nan_recoveries.end(), [&](const NanRecovery& d) {
          return !d.gaussians && d.iteration < iteration &&
                 ViewOfIteration(options.seed, d.iteration, num_views) == photo;
        }));
  }

  bool Skip(size_t photo) const {
    return RecoversHere(/*gaussians=*/false) || Skips(photo, state.iteration) >= kSkipsOfAPhoto;
  }

  size_t PhotosLeftOut() const {
    size_t count = 0;
    for (size_t i = 0; i < num_views; ++i) {
      count += Skips(i, std::numeric_limits<int>::max()) >= kSkipsOfAPhoto;
    }
    return count;
  }

  absl::Status Fail(bool gaussians, const std::string& field, const std::string& what,
                    const std::string& photo) {
    NanRecovery d{state.iteration, gaussians, absl::StrCat(what, " (photo ", photo, ")")};
    const absl::Status status =
        NotFiniteError(field, absl::StrCat(d.source, " at iteration ", d.iteration));
    fault = std::move(d);
    return status;
  }

  // How many of the photo's pixels one of what is compared is wide.
  int ShrinkOf(const TrainView& compared, size_t photo) const {
    return pyramid.View(0, photo).view.camera.width / compared.view.camera.width;
  }

  void Start(Splats initial);
  absl::StatusOr<StepLosses> Learn(size_t photo);

  // `camera` of a photo, of any size, from where that photo was taken as far as is known.
  Camera Refined(size_t photo, const Camera& camera) const {
    return state.poses.empty() ? camera : state.poses[photo].Apply(camera);
  }

  // No photo tells where the world is, how large, nor which way it is turned: refined cameras would
  // drift from the given ones, all alike and the scene with them.
  void HoldWorld() {
    if (state.poses.empty() || state.iteration % num_views != 0) return;
    MoveWorld(AlignPoses(state.poses, given_poses, extent), &state.splats.params,
              absl::MakeSpan(state.poses));
  }

  void ControlDensity() {
    if (!density.IsDue(state.iteration)) return;
    Timer timer(&phases.density);
    density.Step(state.iteration, pyramid.MostGaussians(pyramid.LevelOf(state.iteration)),
                 &state.splats, &state.density);
  }

  TrainOptions options;
  ViewPyramid pyramid;
  size_t num_views;
  std::vector<CameraPose> given_poses;
  double extent;
  DensitySchedule density;
  TrainState state;
  Objective objective;
  Renderer renderer;
  Planes rendered, alpha, v_rendered;
  TrainView cropped;
  PdmWeights v_pdm;
  PhaseSeconds phases;
  std::optional<NanRecovery> fault;  // what the last step met
};

void Trainer::Impl::Start(Splats initial) {
  density.Start(initial);
  state = TrainState();
  state.splats.params = std::move(initial);
  state.splats.moment1 = Splats(state.splats.params.size());
  state.splats.moment2 = Splats(state.splats.params.size());
  state.splats.Rearrange(MortonOrder(state.splats.params));
  state.density.Reset(state.splats.params.size());
  if (options.refine_cameras) state.poses = given_poses;
  if (options.recipe.lita && options.recipe.use_pdm) {
    state.pdm = PdmWeights::Initial(options.recipe.pdm, options.seed);
    state.pdm_moment1 = PdmWeights::Zeros(options.recipe.pdm);
    state.pdm_moment2 = PdmWeights::Zeros(options.recipe.pdm);
  }
}

// One step of gradient descent on a photo.
absl::StatusOr<StepLosses> Trainer::Impl::Learn(size_t photo) {
  const CropGrid grid = pyramid.GridOf(state.iteration, photo);
  PixelRect crop;
  const TrainView& view =
      pyramid.Compared(state.iteration, photo, state.iteration / num_views, &cropped, &crop);
  const bool denoise = pyramid.LevelOf(state.iteration) == 0 && objective.Denoises(state.iteration);
  RenderSettings settings = objective.Settings(denoise);
  settings.crop = crop;
  settings.sh_degree = ShDegreeAt(options, state.iteration);
  settings.dropout = MakeDropout();
  settings.lamp = view.lamp;
  settings.pose_grad = options.refine_cameras;
  {
    Timer timer(&phases.forward);
    renderer.Forward(state.splats.params, Refined(photo, view.view.camera), settings, &rendered,
                     &alpha);
  }
  StepLosses losses;
  {
    Timer timer(&phases.losses);
    losses = objective.Evaluate(view, rendered, state.pdm, state.iteration, denoise, &v_rendered,
                                &v_pdm, grid.WeightOf(crop));
  }
  if (const char* term = NotFinite(losses); term != nullptr) {
    const std::string pixels = PixelsNotFinite(rendered, crop, ShrinkOf(view, photo));
    return Fail(false, term,
                absl::StrCat("the ", term, " loss is not finite",
                             pixels.empty() ? "" : ", nor is the rendered ", pixels),
                view.view.name);
  }
  Timer timer(&phases.backward);
  const AdamStep step = MakeAdamStep(settings.sh_degree);
  if (denoise && !UpdatePdm()) {
    return Fail(false, "denoiser", "the denoiser's gradient is not finite", view.view.name);
  }
  if (const auto lost = UpdateSplats(step); lost.has_value()) {
    // Where the loss's own gradient is to blame, its Gaussians are not.
    const std::string pixels = PixelsNotFinite(v_rendered, crop, ShrinkOf(view, photo));
    return Fail(pixels.empty(), "gradient",
                absl::StrCat("the gradient of the ", pixels.empty() ? "" : "rendered ",
                             pixels.empty() ? NameOfNotFinite(state.splats, *lost) : pixels,
                             " is not finite"),
                view.view.name);
  }
  // Hidden Gaussians have a part in the camera's gradient: it keeps its pose for once.
  if (settings.pose_grad && !RecoversHere(/*gaussians=*/true)) {
    const int turn = state.iteration / static_cast<int>(num_views) + 1;
    const double lr = Falling(options.recipe.lr_cameras, options.recipe.lr_cameras_final);
    if (!StepPose(renderer.pose_grad(), turn, lr, extent, AdamConstants(), &state.poses[photo])) {
      return Fail(false, "camera", "the gradient of the camera is not finite", view.view.name);
    }
  }
  if (state.iteration < density.GrowthEnd()) {
    state.density.Add(renderer.stats(), grid.LargerSide());
  }
  return losses;
}

Trainer::Trainer(const TrainOptions& options, const std::vector<TrainView>* views, Splats initial,
                 double extent)
    : impl_(std::make_unique<Impl>(options, views, extent)) {
  impl_->Start(std::move(initial));
}

Trainer::~Trainer() = default;

int Trainer::iteration() const { return impl_->state.iteration; }
size_t Trainer::num_gaussians() const { return impl_->state.splats.params.size(); }
const PhaseSeconds& Trainer::phases() const { return impl_->phases; }

double Trainer::LastWork() const {
  return impl_->pyramid.WorkOf(std::max(0, iteration() - 1), static_cast<double>(num_gaussians()));
}

WorkForecast Trainer::Forecast(int end) const {
  return ForecastWork(impl_->pyramid, impl_->density, iteration(), end,
                      static_cast<double>(num_gaussians()));
}

int Trainer::PhotoShrink() const { return 1 << impl_->pyramid.LevelOf(iteration()); }

absl::StatusOr<StepLosses> Trainer::Step() {
  Impl& s = *impl_;
  LITAGS_CHECK(!s.fault.has_value());
  const size_t photo = ViewOfIteration(s.options.seed, s.state.iteration, s.num_views);
  StepLosses losses;
  losses.skipped = s.Skip(photo);
  if (!losses.skipped) {
    LITAGS_ASSIGN_OR_RETURN(losses, s.Learn(photo));
  }
  ++s.state.iteration;
  s.HoldWorld();
  s.ControlDensity();
  s.phases.denoise = s.objective.denoise_seconds();
  return losses;
}

absl::Status Trainer::RollBack(const std::string& path, const std::string& fingerprint,
                               Splats initial) {
  Impl& s = *impl_;
  LITAGS_CHECK(s.fault.has_value());
  const NanRecovery fault = *std::exchange(s.fault, std::nullopt);
  const auto give_up = [&](const std::string& why) {
    return NotFiniteError(
        "training",
        absl::StrCat("training met a number that is not finite and cannot go around it (", why,
                     "): ", fault.source, " at iteration ", fault.iteration,
                     "; leave out that photo or its depth map, or check the cameras"));
  };
  if (s.state.nan_recoveries.size() == kMaxNanRecoveries) {
    return give_up(absl::StrCat("after ", kMaxNanRecoveries, " roll-backs"));
  }
  std::vector<NanRecovery> nan_recoveries = std::move(s.state.nan_recoveries);
  nan_recoveries.push_back(fault);
  // Frees what is broken first: the checkpoint's file and state take as much once more.
  s.state.splats = SplatState();
  const absl::Status loaded = LoadCheckpoint(path, fingerprint, fault.iteration);
  if (!loaded.ok()) {
    // What cannot be read now may be a good one: the next SaveCheckpoint would replace it.
    if (!IsOfNoUse(loaded)) return loaded;
    s.Start(std::move(initial));
  }
  s.state.nan_recoveries = std::move(nan_recoveries);
  if (2 * s.PhotosLeftOut() > s.num_views) return give_up("with half of the photos left out");
  return absl::OkStatus();
}

const std::vector<NanRecovery>& Trainer::nan_recoveries() const {
  return impl_->state.nan_recoveries;
}

Model Trainer::Snapshot() const {
  const Impl& s = *impl_;
  Model model;
  model.splats = s.state.splats.params;
  model.lita = s.options.recipe.lita;
  model.use_pdm = s.options.recipe.lita && s.options.recipe.use_pdm;
  model.pdm_options = s.options.recipe.pdm;
  model.pdm = s.state.pdm;
  model.pixel_filter = s.objective.Settings(/*denoise=*/false).pixel_filter;
  model.near_plane = s.options.near_plane;
  model.sh_degree = ShDegreeAt(s.options, s.state.iteration);
  model.iteration = s.state.iteration;
  return model;
}

Camera Trainer::CameraOf(size_t i) const {
  return impl_->Refined(i, impl_->pyramid.View(0, i).view.camera);
}

const std::string& Trainer::checkpoint_target() const { return impl_->state.saved_on; }

absl::Status Trainer::SaveCheckpoint(const std::string& path,
                                     const std::string& fingerprint) const {
  return SaveTrainState(path, fingerprint, impl_->state);
}

bool IsOfNoUse(const absl::Status& loaded) {
  const auto detail = GetErrorDetail(loaded);
  const bool of_another =
      detail && (detail->reason == "CHECKPOINT_MISMATCH" || detail->reason == "CONTAINER_TOO_OLD");
  return of_another || absl::IsNotFound(loaded) || absl::IsDataLoss(loaded) ||
         absl::IsInvalidArgument(loaded);
}

absl::Status Trainer::LoadCheckpoint(const std::string& path, const std::string& fingerprint,
                                     int most_iterations) {
  LITAGS_ASSIGN_OR_RETURN(TrainState state, LoadTrainState(path, fingerprint));
  if (state.iteration > most_iterations) {
    return MakeError(
        absl::StatusCode::kFailedPrecondition, "CHECKPOINT_TOO_LONG", "checkpoint",
        absl::StrCat(path, " has ", state.iteration, " iterations, more than the ", most_iterations,
                     " that are wanted; ask for as many at least, or use another folder"));
  }
  if (state.pdm.nets.size() != impl_->state.pdm.nets.size() ||
      state.pdm.hidden != impl_->state.pdm.hidden) {
    return MakeError(
        absl::StatusCode::kDataLoss, "CHECKPOINT_INCONSISTENT", "checkpoint",
        "checkpoint: the denoiser has another shape; delete the checkpoint to start again");
  }
  if (state.poses.size() != impl_->state.poses.size()) {
    return MakeError(absl::StatusCode::kDataLoss, "CHECKPOINT_INCONSISTENT", "checkpoint",
                     absl::StrCat("checkpoint: it has ", state.poses.size(), " cameras instead of ",
                                  impl_->state.poses.size(), "; delete it to start again"));
  }
  impl_->state = std::move(state);
  impl_->fault.reset();
  return absl::OkStatus();
}

}  // namespace litags
