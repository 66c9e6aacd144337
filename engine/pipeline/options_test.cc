#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <limits>
#include <numeric>
#include <string>

#include "engine/core/error.h"
#include "engine/pipeline/engine.h"
#include "engine/pipeline/train_options.h"

namespace litags {
namespace {

constexpr double kNan = std::numeric_limits<double>::quiet_NaN();

struct Case {
  const char* field;
  std::function<void(ReconstructOptions*)> set;
};

TEST(ReconstructOptions, DefaultsAreValid) {
  const ReconstructOptions options;
  EXPECT_TRUE(options.Validate().ok()) << options.Validate();
}

TEST(ReconstructOptions, BadFieldsAreNamed) {
  using O = ReconstructOptions;
  const Case cases[] = {
      {"theta", [](O* o) { o->theta = -0.1; }},
      {"theta", [](O* o) { o->theta = 1; }},
      {"theta", [](O* o) { o->theta = kNan; }},
      {"contrast", [](O* o) { o->contrast = -0.1; }},
      {"contrast", [](O* o) { o->contrast = 1.1; }},
      {"chroma_smoothing", [](O* o) { o->chroma_smoothing = -1; }},
      {"chroma_smoothing", [](O* o) { o->chroma_smoothing = kNan; }},
      {"exposure_ssim", [](O* o) { o->exposure_ssim = -0.1; }},
      {"exposure_ssim", [](O* o) { o->exposure_ssim = 1.1; }},
      {"exposure_ssim", [](O* o) { o->exposure_ssim = kNan; }},
      {"iterations", [](O* o) { o->iterations = 0; }},
      {"iterations", [](O* o) { o->iterations = 1'000'001; }},
      {"coarse_levels", [](O* o) { o->coarse_levels = -1; }},
      {"coarse_levels", [](O* o) { o->coarse_levels = 5; }},
      {"schedule_iterations", [](O* o) { o->schedule_iterations = -1; }},
      {"schedule_iterations", [](O* o) { o->schedule_iterations = 1'000'001; }},
      {"settle_epochs", [](O* o) { o->settle_epochs = -1; }},
      {"settle_epochs", [](O* o) { o->settle_epochs = kNan; }},
      {"dropout", [](O* o) { o->dropout = 0.95; }},
      {"dropout", [](O* o) { o->dropout = kNan; }},
      {"coarse_until", [](O* o) { o->coarse_until = 0; }},
      {"coarse_until", [](O* o) { o->coarse_until = 1.5; }},
      {"coarse_until", [](O* o) { o->coarse_until = kNan; }},
      {"threads", [](O* o) { o->threads = -1; }},
      {"threads", [](O* o) { o->threads = 1025; }},
      {"max_gaussians", [](O* o) { o->max_gaussians = 999; }},
      {"max_gaussians", [](O* o) { o->max_gaussians = 20'000'001; }},
      {"sh_degree", [](O* o) { o->sh_degree = -1; }},
      {"sh_degree", [](O* o) { o->sh_degree = 4; }},
      {"pdm_hidden", [](O* o) { o->pdm_hidden = 0; }},
      {"pdm_hidden", [](O* o) { o->pdm_hidden = 65; }},
      {"pdm_every", [](O* o) { o->pdm_every = 0; }},
      {"max_image_side", [](O* o) { o->max_image_side = -1; }},
      {"max_image_side", [](O* o) { o->max_image_side = 63; }},
      {"holdout_every", [](O* o) { o->holdout_every = -8; }},
      {"holdout_every", [](O* o) { o->holdout_every = 1; }},
      {"min_registered", [](O* o) { o->min_registered = 0; }},
      {"depth_weight", [](O* o) { o->depth_weight = -0.1; }},
      {"depth_weight", [](O* o) { o->depth_weight = 11; }},
      {"depth_weight", [](O* o) { o->depth_weight = kNan; }},
      {"min_registered", [](O* o) { o->min_registered = 1.01; }},
      {"min_registered", [](O* o) { o->min_registered = kNan; }},
      {"checkpoint_every", [](O* o) { o->checkpoint_every = 0; }},
      {"preview_every", [](O* o) { o->preview_every = 0; }},
  };
  for (const auto& [field, set] : cases) {
    ReconstructOptions options;
    set(&options);
    const absl::Status status = options.Validate();
    EXPECT_EQ(status.code(), absl::StatusCode::kInvalidArgument) << field;
    const auto detail = GetErrorDetail(status);
    ASSERT_TRUE(detail.has_value()) << field << ": " << status;
    EXPECT_EQ(detail->reason, "BAD_OPTION");
    EXPECT_EQ(detail->field, std::string("options.") + field);
    EXPECT_EQ(std::string(status.message()).find(detail->field + ": "), 0u) << status;
  }
}

TEST(ReconstructOptions, LimitsThemselvesAreValid) {
  using O = ReconstructOptions;
  const Case cases[] = {
      {"exposure_ssim", [](O* o) { o->exposure_ssim = 0; }},
      {"exposure_ssim", [](O* o) { o->exposure_ssim = 1; }},
      {"iterations", [](O* o) { o->iterations = 1; }},
      {"iterations", [](O* o) { o->iterations = 1'000'000; }},
      {"coarse_levels", [](O* o) { o->coarse_levels = 0; }},
      {"coarse_levels", [](O* o) { o->coarse_levels = 4; }},
      {"coarse_until", [](O* o) { o->coarse_until = 1; }},
      {"threads", [](O* o) { o->threads = 1024; }},
      {"max_gaussians", [](O* o) { o->max_gaussians = 1000; }},
      {"max_gaussians", [](O* o) { o->max_gaussians = 20'000'000; }},
      {"sh_degree", [](O* o) { o->sh_degree = 0; }},
      {"pdm_hidden", [](O* o) { o->pdm_hidden = 1; }},
      {"pdm_hidden", [](O* o) { o->pdm_hidden = 64; }},
      {"max_image_side", [](O* o) { o->max_image_side = 64; }},
      {"holdout_every", [](O* o) { o->holdout_every = 0; }},
      {"holdout_every", [](O* o) { o->holdout_every = 2; }},
      {"min_registered", [](O* o) { o->min_registered = 1; }},
  };
  for (const auto& [field, set] : cases) {
    ReconstructOptions options;
    set(&options);
    EXPECT_TRUE(options.Validate().ok()) << field << ": " << options.Validate();
  }
}

// Values that no default has, so that a field left behind shows.
TEST(ReconstructOptions, ReachTheTrainer) {
  ReconstructOptions options;
  options.method = Method::k3dgs;
  options.exposure_ssim = 0.3;
  options.iterations = 77;
  options.coarse_levels = 3;
  options.coarse_until = 0.7;
  options.settle_epochs = 9;
  options.dropout = 0.4;
  options.seed = 5;
  options.threads = 3;
  options.max_gaussians = 4321;
  options.sh_degree = 1;
  options.use_pdm = true;
  options.pdm_hidden = 5;
  options.pdm_every = 7;
  options.use_prior = false;
  options.use_depth = false;
  options.depth_weight = 0.7;
  options.depth_geometry = !options.depth_geometry;
  options.density_statistic = DensityStatistic::kAbs;
  options.prior_geometry = !options.prior_geometry;
  const TrainOptions train = TrainOptionsOf(options);
  EXPECT_FALSE(train.lita);
  EXPECT_EQ(train.exposure_ssim, 0.3);
  EXPECT_EQ(train.iterations, 77);
  EXPECT_EQ(train.coarse_levels, 3);
  EXPECT_EQ(train.coarse_until, 0.7);
  EXPECT_EQ(train.settle_epochs, 9);
  EXPECT_EQ(train.dropout, 0) << "plain 3DGS has none";
  EXPECT_EQ(train.seed, 5u);
  EXPECT_EQ(train.threads, 3);
  EXPECT_EQ(train.max_gaussians, 4321);
  EXPECT_EQ(train.sh_degree, 1);
  EXPECT_TRUE(train.use_pdm);
  EXPECT_EQ(train.pdm.hidden, 5);
  EXPECT_EQ(train.pdm_every, 7);
  EXPECT_FALSE(train.use_prior);
  EXPECT_FALSE(train.use_depth);
  EXPECT_EQ(train.weight_depth, 0.7);
  EXPECT_EQ(train.depth_geometry, !ReconstructOptions().depth_geometry);
  EXPECT_EQ(train.prior_geometry, !ReconstructOptions().prior_geometry);
  EXPECT_EQ(train.density_statistic, PixelSum::kAbsGradient);
  EXPECT_EQ(train.growth, Growth::kCloneSplit) << "plain 3DGS has its own";
  EXPECT_EQ(train.pixel_filter, PixelFilter::kDilate);
  options.schedule_iterations = 55;
  EXPECT_EQ(TrainOptionsOf(options).iterations, 55);
  options.density_statistic = DensityStatistic::kPixel;
  EXPECT_EQ(TrainOptionsOf(options).density_statistic, PixelSum::kCount);
  EXPECT_EQ(TrainOptionsOf(ReconstructOptions()).density_statistic, PixelSum::kNone);
  options.method = Method::kLitaGs;
  EXPECT_TRUE(TrainOptionsOf(options).lita);
  EXPECT_EQ(TrainOptionsOf(options).dropout, 0.4);
  EXPECT_EQ(TrainOptionsOf(options).growth, Growth::kLongAxis);
  EXPECT_EQ(TrainOptionsOf(options).pixel_filter, PixelFilter::kMip);
  EXPECT_GT(TrainOptionsOf(options).densify_epochs, 0);
  EXPECT_GT(TrainOptionsOf(options).max_scale, 0);
  EXPECT_GT(TrainOptionsOf(options).clear_space, 0);
  EXPECT_GT(TrainOptionsOf(options).lr_scales, TrainOptions().lr_scales);
  options.antialiased = false;
  EXPECT_EQ(TrainOptionsOf(options).pixel_filter, PixelFilter::kDilate);
  options.density_growth = DensityGrowth::kCloneSplit;
  EXPECT_EQ(TrainOptionsOf(options).growth, Growth::kCloneSplit);
  EXPECT_EQ(TrainOptionsOf(options).densify_epochs, 0) << "as the paper";
  EXPECT_EQ(TrainOptionsOf(options).max_scale, 0);
  EXPECT_EQ(TrainOptionsOf(options).clear_space, 0);
  EXPECT_EQ(TrainOptionsOf(options).lr_scales, TrainOptions().lr_scales);
}

TEST(Stage, HasAName) {
  EXPECT_EQ(StageName(Stage::kLoading), "loading");
  EXPECT_EQ(StageName(Stage::kFindingCameras), "finding-cameras");
  EXPECT_EQ(StageName(Stage::kPreparing), "preparing");
  EXPECT_EQ(StageName(Stage::kTraining), "training");
  EXPECT_EQ(StageName(Stage::kSaving), "saving");
}

TEST(PseudoTarget, IsAsBrightAsWasAskedFor) {
  ImageU8 photo(32, 16);
  for (size_t i = 0; i < photo.data.size(); ++i) photo.data[i] = static_cast<uint8_t>(5 + i % 20);
  ReconstructOptions options;
  options.theta = 0.4;
  for (const Tone tone : {Tone::kPaper, Tone::kLinearGain}) {
    options.tone = tone;
    const auto targets = MakePseudoTargets({photo, photo}, options);
    ASSERT_TRUE(targets.ok()) << targets.status();
    ASSERT_EQ(targets->size(), 2u);
    const std::vector<uint8_t>& data = (*targets)[1].data;
    const double mean = std::accumulate(data.begin(), data.end(), 0.0) / data.size() / 255;
    EXPECT_NEAR(mean, 0.4, 0.5 / 255);
  }
  options.tone = Tone::kNone;
  const auto same = MakePseudoTargets({photo}, options);
  ASSERT_TRUE(same.ok());
  EXPECT_EQ(same->front().data, photo.data);
  options.tone = Tone::kLinearGain;
  for (const ImageU8& bad : {ImageU8(8, 8), ImageU8()}) {
    EXPECT_EQ(MakePseudoTargets({bad}, options).status().code(),
              absl::StatusCode::kInvalidArgument);
  }
}

}  // namespace
}  // namespace litags
