#include "engine/train/trainer.h"

#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>
#include <utility>
#include <vector>

#include "engine/core/error.h"
#include "engine/core/error_test_util.h"
#include "engine/core/image.h"
#include "engine/core/rng.h"
#include "engine/core/temp_dir_test_util.h"
#include "engine/io/container.h"
#include "engine/train/initialize.h"
#include "engine/train/train_test_util.h"
#include "gtest/gtest.h"

namespace litags {
namespace {

constexpr int kIterations = 60;

// Densifies three times and grows its SH degree three times within 60 iterations.
TrainOptions Options() {
  TrainOptions options;
  options.iterations = kIterations;
  options.threads = 1;
  options.recipe.pdm.hidden = 4;
  options.recipe.sh_interval = 15;
  options.recipe.densify_start = 10;
  options.recipe.densify_every = 10;
  options.recipe.densify_grad = 1e-5;
  options.max_gaussians = 400;
  options.recipe.dropout = 0.3;
  // Sixty iterations have to show something.
  options.recipe.lr_sh_dc = options.recipe.lr_attributes = 0.04;
  return options;
}

const std::vector<TrainView>& Views() {
  static const auto* views = new std::vector<TrainView>(DarkViews(ColoredCloud(300, 1), 8, 48, 40));
  return *views;
}

// The scene of the photos with its colours and light forgotten and its places shaken.
Splats Start() {
  Splats splats = ColoredCloud(300, 1);
  const CounterRng rng(2, 2);
  for (size_t i = 0; i < splats.size(); ++i) {
    for (int k = 0; k < 3; ++k) {
      splats.at(i, kMean + k) += static_cast<float>(0.03 * rng.Normal(3 * i + k));
      splats.at(i, kShDc + k) = 0;
      splats.at(i, kNoise + k) = 0;
      splats.at(i, kIllumination + k) = 0.5f;
    }
  }
  return splats;
}

Trainer MakeTrainer(const TrainOptions& options) {
  return Trainer(options, &Views(), Start(), SceneExtent(Views()));
}

std::vector<double> Train(Trainer* trainer, int until) {
  std::vector<double> losses;
  while (trainer->iteration() < until) {
    const absl::StatusOr<StepLosses> step = trainer->Step();
    EXPECT_TRUE(step.ok()) << step.status();
    if (!step.ok()) break;
    losses.push_back(step->Total());
  }
  return losses;
}

void ExpectSame(const Model& a, const Model& b) {
  EXPECT_EQ(a.iteration, b.iteration);
  EXPECT_EQ(a.sh_degree, b.sh_degree);
  EXPECT_EQ(a.splats.size(), b.splats.size());
  EXPECT_TRUE(SameBytes(a.splats.data(), b.splats.data()));
  EXPECT_EQ(a.pdm.nets, b.pdm.nets);
}

double MeanOf(const std::vector<double>& v, size_t first, size_t count) {
  double sum = 0;
  for (size_t i = first; i < first + count; ++i) sum += v[i] / count;
  return sum;
}

TEST(Trainer, LossFallsAndTheSceneGrowsWithinItsBudget) {
  for (const bool lita : {true, false}) {
    SCOPED_TRACE(lita);
    TrainOptions options = Options();
    options.recipe.lita = lita;
    Trainer trainer = MakeTrainer(options);
    const std::vector<double> losses = Train(&trainer, kIterations);
    ASSERT_EQ(losses.size(), size_t{kIterations});
    // Eight views: an epoch at each end.
    EXPECT_LT(MeanOf(losses, kIterations - 8, 8), 0.75 * losses[0]);
    EXPECT_GT(trainer.num_gaussians(), 300u);
    EXPECT_LE(trainer.num_gaussians(), 400u);
    const Model model = trainer.Snapshot();
    EXPECT_EQ(model.iteration, kIterations);
    EXPECT_EQ(model.sh_degree, 3);
    EXPECT_EQ(model.lita, lita);
    EXPECT_EQ(model.use_pdm, lita);
  }
}

TEST(Trainer, NumberOfThreadsDoesNotChangeAByte) {
  TrainOptions options = Options();
  Trainer one = MakeTrainer(options);
  const std::vector<double> losses = Train(&one, 35);
  for (const int threads : {2, 3}) {
    options.threads = threads;
    Trainer more = MakeTrainer(options);
    EXPECT_EQ(Train(&more, 35), losses);
    ExpectSame(one.Snapshot(), more.Snapshot());
  }
}

// Mean |picture - target| over all views.
double ErrorOf(const Model& model, const std::vector<TrainView>& views) {
  double sum = 0;
  size_t samples = 0;
  Renderer renderer;
  Planes image, alpha;
  RenderSettings settings;
  settings.num_channels = kColorOnly;
  for (const TrainView& view : views) {
    renderer.Forward(model.splats, view.view.camera, settings, &image, &alpha);
    for (size_t i = 0; i < image.plane_size(); ++i) {
      for (int c = 0; c < 3; ++c) {
        sum += std::abs(image.plane(c)[i] - EncodedOf(view.target.data[3 * i + c]));
        ++samples;
      }
    }
  }
  return sum / samples;
}

TEST(Trainer, CropsTeachTheWholePhotos) {
  TrainOptions options = Options();
  const double before = ErrorOf(MakeTrainer(options).Snapshot(), Views());
  Trainer whole = MakeTrainer(options);
  Train(&whole, 120);
  options.recipe.crop_pixels = 400;  // 2 x 2 of 48 x 36
  Trainer crops = MakeTrainer(options);
  Train(&crops, 120);
  const double by_whole = ErrorOf(whole.Snapshot(), Views());
  const double by_crops = ErrorOf(crops.Snapshot(), Views());
  EXPECT_GT(before - by_crops, 0.4 * (before - by_whole)) << "with a quarter of the pixels";
}

TEST(Trainer, SeedChangesTheRun) {
  TrainOptions options = Options();
  Trainer a = MakeTrainer(options);
  options.seed = 1;
  Trainer b = MakeTrainer(options);
  EXPECT_NE(Train(&a, 16), Train(&b, 16));
}

TEST(Trainer, ResumedRunEndsWithTheBytesOfAnUninterruptedOne) {
  const TempDir dir;
  // 25 is between two density steps, where sums over views matter; 30 is right after one.
  for (const int stop : {25, 30}) {
    Trainer whole = MakeTrainer(Options());
    Train(&whole, stop);
    ASSERT_TRUE(whole.SaveCheckpoint(dir / "c", "print").ok());
    const std::vector<double> rest = Train(&whole, kIterations);

    Trainer resumed = MakeTrainer(Options());
    Train(&resumed, 3);  // whatever it did before is replaced
    ASSERT_TRUE(resumed.LoadCheckpoint(dir / "c", "print").ok());
    EXPECT_EQ(resumed.iteration(), stop);
    EXPECT_EQ(Train(&resumed, kIterations), rest);
    ExpectSame(whole.Snapshot(), resumed.Snapshot());
  }
}

TEST(Trainer, RefusesCheckpointsItCannotContinue) {
  const TempDir dir;
  Trainer trainer = MakeTrainer(Options());
  Train(&trainer, 2);
  ASSERT_TRUE(trainer.SaveCheckpoint(dir / "good", "print").ok());
  const Model before = trainer.Snapshot();

  const absl::Status other = trainer.LoadCheckpoint(dir / "good", "another");
  EXPECT_EQ(other.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_EQ(Reason(other), "CHECKPOINT_MISMATCH");

  EXPECT_EQ(trainer.LoadCheckpoint(dir / "missing", "print").code(), absl::StatusCode::kNotFound);

  const auto size = std::filesystem::file_size(dir / "good");
  std::filesystem::copy_file(dir / "good", dir / "short");
  std::filesystem::resize_file(dir / "short", size / 2);
  EXPECT_EQ(Reason(trainer.LoadCheckpoint(dir / "short", "print")), "CONTAINER_TRUNCATED");

  std::ofstream(dir / "foreign") << "This is not a checkpoint but a letter to the editor.";
  EXPECT_EQ(Reason(trainer.LoadCheckpoint(dir / "foreign", "print")), "NOT_A_CONTAINER");

  ContainerWriter scene("scene", 1);
  scene.AddSection("meta", "{}");
  ASSERT_TRUE(scene.Commit(dir / "scene").ok());
  EXPECT_EQ(Reason(trainer.LoadCheckpoint(dir / "scene", "print")), "WRONG_CONTAINER_KIND");

  // Same fingerprint, another network: a bug of the caller, but no crash.
  TrainOptions wide = Options();
  wide.recipe.pdm.hidden = 8;
  Trainer wider = MakeTrainer(wide);
  EXPECT_EQ(Reason(wider.LoadCheckpoint(dir / "good", "print")), "CHECKPOINT_INCONSISTENT");

  ExpectSame(trainer.Snapshot(), before);
}

TEST(Trainer, ANumberThatIsNoneStopsTheRunAndNamesTheTerm) {
  const struct {
    int row;
    const char* term;
  } cases[] = {{kShDc, "exposure"}, {kIllumination, "reconstruction"}, {kStructure, "prior"}};
  for (const auto& [row, term] : cases) {
    SCOPED_TRACE(term);
    Splats broken = Start();
    for (size_t i = 0; i < broken.size(); ++i) {
      broken.at(i, row) = std::numeric_limits<float>::quiet_NaN();
    }
    Trainer trainer(Options(), &Views(), std::move(broken), 1);
    const Model before = trainer.Snapshot();
    const absl::StatusOr<StepLosses> step = trainer.Step();
    EXPECT_EQ(step.status().code(), absl::StatusCode::kInternal);
    EXPECT_EQ(Reason(step.status()), "NOT_FINITE");
    EXPECT_EQ(GetErrorDetail(step.status())->field, term);
    ExpectSame(trainer.Snapshot(), before);
  }
}

TEST(Trainer, AblationsTrain) {
  for (int off = 0; off < 8; ++off) {
    SCOPED_TRACE(off);
    TrainOptions options = Options();
    options.recipe.use_pdm = (off & 1) == 0;
    options.recipe.use_prior = (off & 2) == 0;
    options.recipe.use_depth = (off & 4) == 0;
    Trainer trainer = MakeTrainer(options);
    double prior = 0, depth = 0, denoise = 0;
    for (int i = 0; i < 8; ++i) {  // every view once: half of them have depth
      const absl::StatusOr<StepLosses> step = trainer.Step();
      ASSERT_TRUE(step.ok()) << step.status();
      prior += step->prior;
      depth += step->depth;
      denoise += step->denoise;
    }
    EXPECT_EQ(denoise > 0, options.recipe.use_pdm);
    EXPECT_EQ(prior > 0, options.recipe.use_prior);
    EXPECT_EQ(depth > 0, options.recipe.use_depth);
  }
}

TEST(Trainer, DensityGrowsUntilTheEpochsAreOverWithinBounds) {
  const auto last_growth = [](double epochs, int until) {
    TrainOptions options = Options();
    options.recipe.densify_epochs = epochs;
    options.recipe.densify_until = until;
    options.max_gaussians = 100000;
    Trainer trainer = MakeTrainer(options);
    int last = 0;
    for (int i = 1; i <= kIterations; ++i) {
      const size_t before = trainer.num_gaussians();
      Train(&trainer, i);
      if (trainer.num_gaussians() != before) last = i;
    }
    return last;
  };
  const double eight_photos = 1 / 8.0;
  EXPECT_EQ(last_growth(0, 5000), 30) << "half of the run";
  EXPECT_EQ(last_growth(10 * eight_photos, 5000), 30) << "no less";
  EXPECT_EQ(last_growth(41 * eight_photos, 5000), 40);
  EXPECT_EQ(last_growth(1000, 5000), 40) << "0.7 of the run";
  EXPECT_EQ(last_growth(1000, 25), 20);
}

double ToNearestCamera(const Splats& splats, size_t i) {
  double nearest = std::numeric_limits<double>::infinity();
  for (const TrainView& v : Views()) {
    const auto c = v.view.camera.Center();
    nearest =
        std::min(nearest, std::hypot(c[0] - splats.at(i, kMean), c[1] - splats.at(i, kMean + 1),
                                     c[2] - splats.at(i, kMean + 2)));
  }
  return nearest;
}

TEST(Trainer, NoGaussianIsWiderThanItsDistanceToTheCamerasAllows) {
  const auto widest = [](double max_scale) {
    TrainOptions options = Options();
    options.recipe.max_scale = max_scale;
    options.recipe.lr_scales = 0.2;     // they all grow wide soon
    options.recipe.densify_until = 20;  // cut after growth as well
    Trainer trainer = MakeTrainer(options);
    Train(&trainer, kIterations);
    const Splats splats = trainer.Snapshot().splats;
    double most = 0;
    for (size_t i = 0; i < splats.size(); ++i) {
      for (int k = 0; k < 3; ++k) {
        most = std::max(most, std::exp(splats.at(i, kLogScale + k)) / ToNearestCamera(splats, i));
      }
    }
    return most;
  };
  EXPECT_GT(widest(0), 0.06);
  EXPECT_LT(widest(0.05), 0.05 + 1e-6);
}

TEST(Trainer, TheSpaceBeforeTheCamerasIsKeptClear) {
  const auto nearest = [](double clear_space) {
    TrainOptions options = Options();
    options.recipe.near_camera_pruning = clear_space;
    Trainer trainer = MakeTrainer(options);
    Train(&trainer, kIterations);
    const Splats splats = trainer.Snapshot().splats;
    double least = std::numeric_limits<double>::infinity();
    for (size_t i = 0; i < splats.size(); ++i) {
      if (splats.at(i, kLogitOpacity) > -9) least = std::min(least, ToNearestCamera(splats, i));
    }
    return least;
  };
  const double without = nearest(0);
  EXPECT_NEAR(nearest(0.5), without, 1e-9) << "none is that near";
  // They move between density steps.
  EXPECT_GT(nearest(1.3), 1.25 * without);
}

TEST(Trainer, APriorThatMovesNothingTrainsItsAttributeAlone) {
  const auto train = [](bool use_prior, bool geometry) {
    TrainOptions options = Options();
    options.recipe.use_prior = use_prior;
    options.recipe.prior_geometry = geometry;
    Trainer trainer = MakeTrainer(options);
    Train(&trainer, kIterations);
    return trainer.Snapshot().splats;
  };
  const Splats none = train(false, false), detached = train(true, false), paper = train(true, true);
  ASSERT_EQ(detached.size(), none.size());
  bool trained = false;
  for (size_t i = 0; i < none.size(); ++i) {
    for (int row = 0; row < kSplatRows; ++row) {
      if (row == kStructure) {
        trained |= detached.at(i, row) != none.at(i, row);
      } else {
        ASSERT_EQ(detached.at(i, row), none.at(i, row)) << i << " row " << row;
      }
    }
  }
  EXPECT_TRUE(trained);
  EXPECT_FALSE(SameBytes(paper.data(), detached.data()));
}

TEST(Trainer, LearningRatesOfZeroFreezeTheMeans) {
  TrainOptions options = Options();
  options.recipe.lr_means = options.recipe.lr_means_final = 0;
  options.recipe.densify_start = kIterations;
  Trainer trainer = MakeTrainer(options);
  const Model before = trainer.Snapshot();
  Train(&trainer, 5);
  const Model after = trainer.Snapshot();
  for (size_t i = 0; i < before.splats.size(); ++i) {
    ASSERT_EQ(before.splats.at(i, kMean), after.splats.at(i, kMean));
  }
  EXPECT_FALSE(SameBytes(before.splats.data(), after.splats.data()));
}

// The largest step of a colour in iteration `at`: Adam's are about the learning rate.
double LargestStep(const TrainOptions& options, int at) {
  Trainer trainer = MakeTrainer(options);
  Train(&trainer, at);
  const Splats before = trainer.Snapshot().splats;
  Train(&trainer, at + 1);
  const Splats after = trainer.Snapshot().splats;
  double largest = 0;
  for (size_t i = 0; i < before.size(); ++i)
    largest = std::max(largest, std::abs(double(after.at(i, kShDc)) - before.at(i, kShDc)));
  return largest;
}

TEST(Trainer, RatesFallByTheEpochsAtFullSize) {
  const auto moved = [](double decay_epochs) {
    TrainOptions options = Options();
    options.recipe.densify_until = 0;
    options.recipe.lr_decay_epochs = decay_epochs;
    return LargestStep(options, 32);
  };
  // 32 iterations of 8 photos: 4 epochs, so 1 / (1 + 4 / 0.5) of the constant rate, more or less:
  // the two runs are at different places.
  const double constant = moved(0), decayed = moved(0.5);
  EXPECT_GT(constant, 0.02);
  EXPECT_LT(decayed, constant / 4);
  EXPECT_GT(decayed, constant / 20);
}

TEST(Trainer, BeyondItsScheduleTheRatesAreThoseOfItsEnd) {
  TrainOptions options = Options();
  options.iterations = 32;
  options.recipe.densify_until = 0;
  options.recipe.lr_decay_epochs = 0.5;
  // 40 epochs would leave a ninth of the rate after 4.
  EXPECT_GT(LargestStep(options, 320), LargestStep(options, 32) / 4);
}

// Before and after iteration `at`.
std::pair<Model, Model> AroundIteration(const TrainOptions& options,
                                        const std::vector<TrainView>& views, int at) {
  Trainer trainer(options, &views, Start(), SceneExtent(views));
  Train(&trainer, at);
  Model before = trainer.Snapshot();
  Train(&trainer, at + 1);
  return {std::move(before), trainer.Snapshot()};
}

// Gaussians that iteration `at` leaves as they were, out of 300.
int LeftOut(double dropout, int at, int scheduled) {
  const std::vector<TrainView> views = Views();
  TrainOptions options = Options();
  options.iterations = scheduled;
  options.recipe.densify_until = 0;
  options.recipe.dropout = dropout;
  const auto [before, after] = AroundIteration(options, views, at);
  int same = 0;
  for (size_t i = 0; i < before.splats.size(); ++i) {
    same += before.splats.at(i, kShDc) == after.splats.at(i, kShDc);
  }
  return same;
}

TEST(Trainer, DropoutGrowsWithTheEpochsAtFullSize) {
  EXPECT_EQ(LeftOut(0.9, 0, 500), LeftOut(0, 0, 500)) << "all photos are new";
  // 50 epochs of 8 photos: 0.9 x 50 / (50 + 50) = 0.45 of those in view; without it all are.
  const int hidden = LeftOut(0, 400, 500);
  EXPECT_LT(hidden, 60);
  EXPECT_NEAR(LeftOut(0.9, 400, 500) - hidden, 0.45 * (300 - hidden), 35) << hidden;
  // Of a schedule of two epochs: 0.9 x 2 / (2 + 50) = 0.03.
  EXPECT_NEAR(LeftOut(0.9, 400, 16) - hidden, 0.03 * (300 - hidden), 35) << "beyond the schedule";
}

// The largest step of the denoiser's weights in iteration `at`, over their rate.
double LargestPdmStep(const TrainOptions& options, const std::vector<TrainView>& views, int at) {
  const auto [model_before, model_after] = AroundIteration(options, views, at);
  const PdmWeights &before = model_before.pdm, &after = model_after.pdm;
  double largest = 0;
  for (size_t k = 0; k < before.nets.size(); ++k) {
    for (size_t i = 0; i < before.nets[k].size(); ++i) {
      largest = std::max(largest, std::abs(double(after.nets[k][i]) - before.nets[k][i]));
    }
  }
  return largest / options.recipe.lr_pdm;
}

// Adam's first step is the rate, and so is a second one with the same gradient.
TEST(Trainer, TheDenoiserCountsItsOwnSteps) {
  const std::vector<TrainView> views = DarkViews(ColoredCloud(300, 1), 2, 128, 128);
  TrainOptions options = Options();
  options.recipe.coarse_levels = 1;
  options.recipe.coarse_until = 0.5;  // 30 of 60 iterations
  for (const int every : {1, 4}) {
    options.recipe.pdm_every = every;
    const int first = every == 1 ? 30 : 32;
    EXPECT_EQ(LargestPdmStep(options, views, first - 1), 0) << every;
    EXPECT_NEAR(LargestPdmStep(options, views, first), 1, 0.02) << every;
    EXPECT_NEAR(LargestPdmStep(options, views, first + every), 1, 0.05) << every;
  }
}

}  // namespace
}  // namespace litags
