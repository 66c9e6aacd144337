#include <cmath>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "engine/pipeline/engine.h"
#include "engine/pipeline/train_options.h"

namespace litags {
namespace {

absl::Status Bad(const char* field, double value, const char* rule) {
  return InvalidInput("BAD_OPTION", absl::StrCat("options.", field),
                      absl::StrCat("options.", field, ": ", value, " ", rule));
}

// TrainOptions of Gaussians that grow by halves. Choices
constexpr double kDensifyEpochs = 60;
constexpr double kLrScales = 0.01;
constexpr double kMaxScale = 0.5;
constexpr double kClearSpace = 0.5;

PixelSum PixelSumOf(DensityStatistic statistic) {
  switch (statistic) {
    case DensityStatistic::kMean:
      break;
    case DensityStatistic::kAbs:
      return PixelSum::kAbsGradient;
    case DensityStatistic::kPixel:
      return PixelSum::kCount;
  }
  return PixelSum::kNone;
}

Growth GrowthOf(DensityGrowth growth) {
  return growth == DensityGrowth::kLongAxis ? Growth::kLongAxis : Growth::kCloneSplit;
}

}  // namespace

TrainOptions TrainOptionsOf(const ReconstructOptions& options) {
  TrainOptions train;
  train.iterations = options.ScheduleIterations();  // it is stepped from outside
  train.seed = options.seed;
  train.threads = options.threads;
  train.lita = options.method == Method::kLitaGs;
  train.exposure_ssim = options.exposure_ssim;
  train.use_pdm = options.use_pdm;
  train.pdm.hidden = options.pdm_hidden;
  train.pdm_every = options.pdm_every;
  train.coarse_levels = options.coarse_levels;
  train.coarse_until = options.coarse_until;
  train.settle_epochs = options.settle_epochs;
  if (train.lita) {
    train.dropout = options.dropout;
    train.growth = GrowthOf(options.density_growth);
    if (options.antialiased) train.pixel_filter = PixelFilter::kMip;
    if (train.growth == Growth::kLongAxis) {
      train.densify_epochs = kDensifyEpochs;
      train.lr_scales = kLrScales;
      train.max_scale = kMaxScale;
      train.clear_space = kClearSpace;
    }
  }
  train.use_prior = options.use_prior;
  train.prior_geometry = options.prior_geometry;
  train.use_depth = options.use_depth;
  train.weight_depth = options.depth_weight;
  train.depth_geometry = options.depth_geometry;
  train.sh_degree = options.sh_degree;
  train.max_gaussians = options.max_gaussians;
  train.density_statistic = PixelSumOf(options.density_statistic);
  return train;
}

absl::Status ReconstructOptions::Validate() const {
  if (!(theta >= 0 && theta < 1)) return Bad("theta", theta, "is not in [0, 1) (0: automatic)");
  if (!(contrast >= 0 && contrast <= 1)) return Bad("contrast", contrast, "is not in [0, 1]");
  if (!(chroma_smoothing >= 0 && chroma_smoothing <= 100)) {
    return Bad("chroma_smoothing", chroma_smoothing, "is not in [0, 100]");
  }
  if (!(exposure_ssim >= 0 && exposure_ssim <= 1))
    return Bad("exposure_ssim", exposure_ssim, "is not in [0, 1]");
  if (iterations < 1 || iterations > 1'000'000)
    return Bad("iterations", iterations, "is not in 1..1000000");
  if (schedule_iterations < 0 || schedule_iterations > 1'000'000)
    return Bad("schedule_iterations", schedule_iterations, "is not in 0..1000000 (0: iterations)");
  if (coarse_levels < 0 || coarse_levels > 4)
    return Bad("coarse_levels", coarse_levels, "is not in 0..4");
  if (!(coarse_until > 0 && coarse_until <= 1))
    return Bad("coarse_until", coarse_until, "is not in (0, 1]");
  if (!(settle_epochs >= 0 && settle_epochs <= 1e6))
    return Bad("settle_epochs", settle_epochs, "is not in [0, 1000000]");
  if (!(dropout >= 0 && dropout <= kMaxDropout))
    return Bad("dropout", dropout, "is not in [0, 0.9]");
  if (threads < 0 || threads > 1024)
    return Bad("threads", threads, "is not in 0..1024 (0: all cores)");
  if (max_gaussians < 1000 || max_gaussians > 20'000'000) {
    return Bad("max_gaussians", double(max_gaussians), "is not in 1000..20000000");
  }
  if (sh_degree < 0 || sh_degree > 3) return Bad("sh_degree", sh_degree, "is not in 0..3");
  if (!(depth_weight >= 0 && depth_weight <= 10))
    return Bad("depth_weight", depth_weight, "is not in [0, 10]");
  if (max_image_side < 0 || (max_image_side > 0 && max_image_side < 64)) {
    return Bad("max_image_side", max_image_side, "is neither 0 (never shrink) nor 64 or more");
  }
  if (holdout_every < 0 || holdout_every == 1) {
    return Bad("holdout_every", holdout_every, "is neither 0 (none) nor 2 or more");
  }
  if (!(min_registered > 0 && min_registered <= 1)) {
    return Bad("min_registered", min_registered, "is not in (0, 1]");
  }
  if (pdm_hidden < 1 || pdm_hidden > 64) return Bad("pdm_hidden", pdm_hidden, "is not in 1..64");
  if (pdm_every < 1) return Bad("pdm_every", pdm_every, "is not 1 or more");
  if (checkpoint_every < 1) return Bad("checkpoint_every", checkpoint_every, "is not 1 or more");
  if (preview_every < 1) return Bad("preview_every", preview_every, "is not 1 or more");
  return TrainOptionsOf(*this).Validate();
}

std::string_view StageName(Stage stage) {
  switch (stage) {
    case Stage::kLoading:
      return "loading";
    case Stage::kFindingCameras:
      return "finding-cameras";
    case Stage::kPreparing:
      return "preparing";
    case Stage::kTraining:
      return "training";
    case Stage::kSaving:
      return "saving";
  }
  return "unknown";
}

}  // namespace litags
