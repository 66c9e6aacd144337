// A number that is not finite is caught in its iteration, and the run finds a way around it.
#include "engine/train/nan_recovery.h"

#include <sys/resource.h>

#include <cmath>
#include <fstream>
#include <limits>
#include <string>
#include <vector>

#include "engine/core/error_test_util.h"
#include "engine/core/image.h"
#include "engine/core/simd_test_util.h"
#include "engine/core/temp_dir_test_util.h"
#include "engine/io/container_test_util.h"
#include "engine/train/crop.h"
#include "engine/train/initialize.h"
#include "engine/train/train_state.h"
#include "engine/train/train_test_util.h"
#include "engine/train/trainer.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace litags {
namespace {

using ::testing::HasSubstr;

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr float kInf = std::numeric_limits<float>::infinity();
constexpr int kIterations = 40;
constexpr size_t kCount = 300;

TEST(Adam, ReportsTheLanesThatAreNoLongerFinite) {
  // What goes in at lane 3, row 5, and whether that lane is then lost. A gradient of 1e30
  // overflows the second moment.
  const struct {
    float gradient, value;
    bool lost;
  } cases[] = {{0.5f, 1, false}, {kNan, 1, true},    {kInf, 1, true},
               {1e30f, 1, true}, {0.5f, kInf, true}, {1e15f, 1, false}};
  ForEachTarget([&] {
    for (const auto& [gradient, value, lost] : cases) {
      for (const uint32_t visible : {0xFFFFu, 0xFFF7u}) {
        Splats params(kSplatBlock), m1(kSplatBlock), m2(kSplatBlock);
        AlignedFloats grads(Splats::kBlockFloats);
        grads[5 * kSplatBlock + 3] = gradient;
        params.at(3, 5) = value;
        AdamStep step(1, AdamConstants());
        step.lr.fill(1e-3f);
        const uint32_t bad = AdamUpdateBlock(step, grads.data(), visible, 0, &params, &m1, &m2);
        EXPECT_EQ(bad, lost ? visible & 8 : 0) << gradient << " " << value;
      }
    }
  });
}

TEST(Adam, ReportsAFlatArrayThatIsNoLongerFinite) {
  const AdamStep step(1, AdamConstants());
  for (const float gradient : {0.5f, kNan, kInf, 1e30f}) {
    std::vector<float> grads = {0.1f, gradient}, x(2), m1(2), m2(2);
    EXPECT_EQ(
        AdamUpdate(step, 1e-3f, grads, absl::MakeSpan(x), absl::MakeSpan(m1), absl::MakeSpan(m2)),
        gradient == 0.5f);
  }
}

TEST(NanRecovery, NamesTheFirstChannelThatIsNotFinite) {
  Planes rendered(kNumChannels, 4, 6);
  const PixelRect whole = {0, 0, 6, 4};
  EXPECT_EQ(PixelsNotFinite(rendered, whole, 1), "");
  rendered.at(kChannelIllumination + 1, 2, 3) = kNan;
  rendered.at(kChannelIllumination + 1, 3, 1) = kInf;
  EXPECT_EQ(PixelsNotFinite(rendered, whole, 1), "light in 2 px, first at (3, 2)");
  EXPECT_EQ(PixelsNotFinite(rendered, {10, 20, 6, 4}, 4), "light in 2 px, first at (52, 88)");
}

// A depth map with an eighth of differences that overflow: the loss is a number, its gradient not.
void SpoilDepth(TrainView* view) {
  ASSERT_TRUE(view->depth.has_value());
  for (size_t i = 0; i < view->depth->depth.data.size(); ++i) {
    view->depth->depth.data[i] = i % 8 == 0 ? -3e38f : 3e38f;
  }
}

// A run over eight views that breaks down where a test wants it to.
class Training {
 public:
  explicit Training(int width = 48, int height = 40)
      : views_(DarkViews(ColoredCloud(kCount, 1), 8, width, height)), initial_(Initial()) {
    options_.iterations = kIterations;
    options_.threads = 1;
    options_.recipe.pdm.hidden = 2;
    options_.recipe.sh_interval = 15;
    options_.recipe.densify_start = 10;
    options_.recipe.densify_every = 10;
    options_.recipe.densify_grad = 1e-5;
    options_.max_gaussians = 400;
  }

  // This photo's depth is compared with NaN.
  void SpoilPhoto(size_t i) {
    Planes& depth = views_[i].depth.emplace().depth;
    depth = Planes(1, views_[i].photo.height, views_[i].photo.width);
    std::fill(depth.data.begin(), depth.data.end(), kNan);
  }

  // A Gaussian larger than a float's square root can hold: its gradient overflows.
  void SpoilGaussian(size_t i) {
    for (int k = 0; k < 3; ++k) initial_.at(i, kLogScale + k) = 45;
  }

  void RefineCameras() { options_.refine_cameras = true; }

  // The first half of the iterations compares crops of photos at half their size.
  void LearnCropsOfHalves(int pixels) {
    options_.recipe.coarse_levels = 1;
    options_.recipe.crop_pixels = pixels;
  }

  // Trains to the end with a checkpoint every `every` iterations, rolling back as often as needed.
  absl::Status Train(int every) {
    const TempDir dir;
    trainer_ = std::make_unique<Trainer>(options_, &views_, initial_, SceneExtent(views_));
    while (trainer_->iteration() < kIterations) {
      const auto losses = trainer_->Step();
      if (!losses.ok()) {
        EXPECT_EQ(Reason(losses.status()), "NOT_FINITE") << losses.status();
        faults_.push_back(losses.status());
        const absl::Status status = trainer_->RollBack(dir / "checkpoint", "print", initial_);
        if (!status.ok()) return status;
      } else if (trainer_->iteration() % every == 0) {
        EXPECT_TRUE(trainer_->SaveCheckpoint(dir / "checkpoint", "print").ok());
      }
    }
    return absl::OkStatus();
  }

  const Trainer& trainer() const { return *trainer_; }
  const std::vector<absl::Status>& faults() const { return faults_; }
  const std::vector<TrainView>& views() const { return views_; }
  TrainView* view(size_t i) { return &views_[i]; }
  const TrainOptions& options() const { return options_; }

 private:
  static Splats Initial() {
    Splats splats = ColoredCloud(kCount, 1);
    for (size_t i = 0; i < kCount; ++i) splats.at(i, kShDc) += 0.2f;
    return splats;
  }

  std::vector<TrainView> views_;
  Splats initial_;
  TrainOptions options_;
  std::unique_ptr<Trainer> trainer_;
  std::vector<absl::Status> faults_;
};

void ExpectFinite(const Splats& splats) {
  ASSERT_GT(splats.size(), 0u);
  for (const float x : splats.data()) ASSERT_TRUE(std::isfinite(x));
}

TEST(RollBack, APhotoIsSkippedTwiceAndThenLeftOut) {
  Training run;
  run.SpoilPhoto(5);
  ASSERT_TRUE(run.Train(/*every=*/7).ok());
  // Forty iterations show every photo five times.
  ASSERT_EQ(run.trainer().nan_recoveries().size(), 2u);
  for (const NanRecovery& d : run.trainer().nan_recoveries()) {
    EXPECT_FALSE(d.gaussians);
    EXPECT_EQ(d.source,
              "the gradient of the rendered depth in 1920 px, first at (0, 0) is not finite (photo "
              "photo5.png)");
  }
  EXPECT_LT(run.trainer().nan_recoveries()[0].iteration,
            run.trainer().nan_recoveries()[1].iteration);
  EXPECT_THAT(
      std::string(run.faults()[0].message()),
      HasSubstr("at iteration " + std::to_string(run.trainer().nan_recoveries()[0].iteration)));
  ExpectFinite(run.trainer().Snapshot().splats);
}

TEST(RollBack, PixelsOfCropsOfSmallerPhotosAreNamedAsThePhotoHasThem) {
  constexpr int kWidth = 160, kHeight = 128, kPixels = 1300;
  Training run(kWidth, kHeight);
  run.LearnCropsOfHalves(kPixels);
  const CropGrid grid(kWidth / 2, kHeight / 2, kPixels);
  const auto crop_of = [&](size_t photo, uint64_t visit) {
    return DrawCrop(grid, run.options().seed, photo, visit);
  };
  size_t photo = 0;
  while (crop_of(photo, 0).x == 0 || crop_of(photo, 0).y == 0) ++photo;
  ASSERT_LT(photo, run.views().size());
  run.SpoilPhoto(photo);
  ASSERT_TRUE(run.Train(/*every=*/7).ok());
  ASSERT_EQ(run.trainer().nan_recoveries().size(), 2u);
  for (uint64_t visit = 0; visit < 2; ++visit) {
    const PixelRect crop = crop_of(photo, visit);
    EXPECT_THAT(run.trainer().nan_recoveries()[visit].source,
                HasSubstr("first at (" + std::to_string(2 * crop.x) + ", " +
                          std::to_string(2 * crop.y) + ")"));
  }
}

void ExpectTheGaussianIsRemoved(Training& run) {
  run.SpoilGaussian(17);
  ASSERT_TRUE(run.Train(/*every=*/7).ok());
  ASSERT_EQ(run.trainer().nan_recoveries().size(), 1u) << run.trainer().nan_recoveries()[1].source;
  EXPECT_TRUE(run.trainer().nan_recoveries()[0].gaussians);
  EXPECT_EQ(run.trainer().nan_recoveries()[0].iteration, 0);
  EXPECT_THAT(run.trainer().nan_recoveries()[0].source,
              HasSubstr("the gradient of the mean of Gaussian"));
  const Splats splats = run.trainer().Snapshot().splats;
  ExpectFinite(splats);
  EXPECT_GT(splats.size(), kCount / 2);
  for (size_t i = 0; i < splats.size(); ++i) EXPECT_LT(splats.at(i, kLogScale), 10);
}

TEST(RollBack, AGaussianWithoutAFiniteGradientIsRemovedAndTheOthersLearn) {
  Training run;
  ExpectTheGaussianIsRemoved(run);
}

// Its gradient is a part of the camera's.
TEST(RollBack, AGaussianWithoutAFiniteGradientIsRemovedWhereCamerasAreRefined) {
  Training run;
  run.RefineCameras();
  ExpectTheGaussianIsRemoved(run);
}

TEST(RollBack, AGradientOfTheLossThatIsNotFiniteCostsNoGaussians) {
  Training run;
  SpoilDepth(run.view(4));
  ASSERT_TRUE(run.Train(/*every=*/7).ok());
  ASSERT_EQ(run.trainer().nan_recoveries().size(), 2u);
  for (const NanRecovery& d : run.trainer().nan_recoveries()) {
    EXPECT_FALSE(d.gaussians);
    EXPECT_THAT(d.source, HasSubstr("the gradient of the rendered depth in 240 px, first at"));
    EXPECT_THAT(d.source, HasSubstr("photo4.png"));
  }
  EXPECT_GT(run.trainer().num_gaussians(), kCount / 2);
}

// Iterations between the checkpoint and the fault are repeated exactly.
TEST(RollBack, WhereTheRunWentBackToChangesNothing) {
  std::vector<Model> models;
  for (const int every : {7, 9, kIterations}) {  // the last: always back to the start
    Training run;
    run.SpoilPhoto(2);
    ASSERT_TRUE(run.Train(every).ok());
    EXPECT_EQ(run.faults().size(), 2u);
    models.push_back(run.trainer().Snapshot());
  }
  for (size_t i = 1; i < models.size(); ++i) {
    EXPECT_TRUE(SameBytes(models[0].splats.data(), models[i].splats.data()));
    EXPECT_EQ(models[0].pdm.nets, models[i].pdm.nets);
  }
}

TEST(RollBack, NanRecoveriesAreKeptInCheckpoints) {
  const TempDir dir;
  Training run;
  run.SpoilPhoto(2);
  ASSERT_TRUE(run.Train(/*every=*/7).ok());
  ASSERT_TRUE(run.trainer().SaveCheckpoint(dir / "c", "print").ok());
  Trainer resumed(run.options(), &run.views(), ColoredCloud(kCount, 1), 1);
  ASSERT_TRUE(resumed.LoadCheckpoint(dir / "c", "print").ok());
  const std::vector<NanRecovery>&want = run.trainer().nan_recoveries(),
        &got = resumed.nan_recoveries();
  ASSERT_EQ(got.size(), want.size());
  for (size_t i = 0; i < want.size(); ++i) {
    EXPECT_EQ(got[i].iteration, want[i].iteration);
    EXPECT_EQ(got[i].gaussians, want[i].gaussians);
    EXPECT_EQ(got[i].source, want[i].source);
  }
}

TEST(RollBack, AnErrorOfReadingIsToldAndStartsNothingAnew) {
  const TempDir dir;
  Training run;
  run.SpoilPhoto(2);
  const Splats initial = ColoredCloud(kCount, 1);
  Trainer trainer(run.options(), &run.views(), initial, SceneExtent(run.views()));
  ASSERT_TRUE(trainer.SaveCheckpoint(dir / "c", "print").ok());
  while (trainer.Step().ok()) {
  }
  rlimit before;
  ASSERT_EQ(getrlimit(RLIMIT_NOFILE, &before), 0);
  const rlimit no_files = {0, before.rlim_max};
  ASSERT_EQ(setrlimit(RLIMIT_NOFILE, &no_files), 0);
  const absl::Status status = trainer.RollBack(dir / "c", "print", initial);
  ASSERT_EQ(setrlimit(RLIMIT_NOFILE, &before), 0);
  EXPECT_EQ(Reason(status), "IO_ERROR") << status;
}

TEST(RollBack, ACheckpointOfANewerProgramIsToldAndStartsNothingAnew) {
  const TempDir dir;
  Training run;
  run.SpoilPhoto(2);
  const Splats initial = ColoredCloud(kCount, 1);
  Trainer trainer(run.options(), &run.views(), initial, SceneExtent(run.views()));
  ASSERT_TRUE(trainer.SaveCheckpoint(dir / "c", "print").ok());
  RewriteAsVersion(dir / "c", "checkpoint", kCheckpointVersion + 1);
  while (trainer.Step().ok()) {
  }
  EXPECT_EQ(Reason(trainer.RollBack(dir / "c", "print", initial)), "CONTAINER_TOO_NEW");
}

TEST(RollBack, ACheckpointOfNoUseMeansTheStart) {
  const TempDir dir;
  std::ofstream(dir / "foreign") << "a note";
  Training run;
  run.SpoilPhoto(2);
  const Splats initial = ColoredCloud(kCount, 1);
  for (const char* name : {"missing", "foreign", "of another run"}) {
    Trainer trainer(run.options(), &run.views(), initial, SceneExtent(run.views()));
    ASSERT_TRUE(trainer.SaveCheckpoint(dir / "of another run", "another").ok());
    while (trainer.Step().ok()) {
    }
    EXPECT_TRUE(trainer.RollBack(dir / name, "print", initial).ok()) << name;
    EXPECT_EQ(trainer.iteration(), 0);
    EXPECT_EQ(trainer.num_gaussians(), kCount);
  }
}

TEST(RollBack, GivesUpWhenTooManyPhotosAreSpoilt) {
  Training run;
  for (const size_t i : {0, 2, 3, 5, 6}) run.SpoilPhoto(i);
  const absl::Status status = run.Train(/*every=*/7);
  EXPECT_EQ(status.code(), absl::StatusCode::kInternal);
  EXPECT_EQ(Reason(status), "NOT_FINITE");
  EXPECT_THAT(std::string(status.message()), HasSubstr("after 8 roll-backs"));
  EXPECT_THAT(std::string(status.message()), HasSubstr("first at (0, 0) is not finite (photo"));
  EXPECT_EQ(run.faults().size(), kMaxNanRecoveries + 1);
}

// One parameter of one Gaussian, at whatever value a float can have: the run ends with a finite
// scene or says what went wrong.
TEST(RollBack, NoParameterOfAGaussianSpoilsAScene) {
  for (const int row : {kMean, kLogScale, kRawQuat, kLogitOpacity, kShDc, kDepth, kStructure,
                        kNoise, kIllumination, kShRest}) {
    for (const float value : {-3e38f, -1e20f, -90.f, 0.f, 42.f, 90.f, 1e18f, 3e38f}) {
      SCOPED_TRACE(testing::Message() << "row " << row << " value " << value);
      Training run;
      Splats initial = ColoredCloud(kCount, 1);
      initial.at(17, row) = value;
      TrainOptions options = run.options();
      options.iterations = 4;
      Trainer trainer(options, &run.views(), initial, 1);
      while (trainer.iteration() < 4) {
        if (trainer.Step().ok()) continue;
        const absl::Status status = trainer.RollBack("/nonexistent", "", initial);
        if (status.ok()) continue;
        EXPECT_EQ(Reason(status), "NOT_FINITE");
        break;
      }
      if (trainer.iteration() == 4) ExpectFinite(trainer.Snapshot().splats);
    }
  }
}

}  // namespace
}  // namespace litags
