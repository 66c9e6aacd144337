#include "engine/train/camera_pose.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "engine/core/error_test_util.h"
#include "engine/core/image.h"
#include "engine/core/rng.h"
#include "engine/core/temp_dir_test_util.h"
#include "engine/render/renderer.h"
#include "engine/train/crop.h"
#include "engine/train/fit_camera.h"
#include "engine/train/initialize.h"
#include "engine/train/train_test_util.h"
#include "engine/train/trainer.h"
#include "gtest/gtest.h"

namespace litags {
namespace {

using RowMajor = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

constexpr int kViews = 8;

const std::vector<TrainView>& Views() {
  static const auto* views =
      new std::vector<TrainView>(DarkViews(ColoredCloud(300, 1), kViews, 64, 56));
  return *views;
}

// The camera turned by about `angle`, radians, and shifted by about `shift`.
Camera Shaken(const Camera& camera, double angle, double shift, uint64_t seed) {
  const CounterRng rng(seed, 1);
  const Eigen::Vector3d axis =
      Eigen::Vector3d(rng.Normal(0), rng.Normal(1), rng.Normal(2)).normalized();
  Camera out = camera;
  Eigen::Map<RowMajor>(out.R.data()) =
      Eigen::AngleAxisd(angle, axis) * Eigen::Map<const RowMajor>(camera.R.data());
  for (int k = 0; k < 3; ++k) out.t[k] += shift * rng.Normal(3 + k) / std::sqrt(3);
  return out;
}

std::vector<TrainView> ShakenViews(double angle, double shift) {
  std::vector<TrainView> views = Views();
  for (int i = 0; i < kViews; ++i) {
    views[i].view.camera = Shaken(views[i].view.camera, angle, shift, i);
  }
  return views;
}

std::vector<CameraPose> PosesOf(const std::vector<TrainView>& views) {
  std::vector<CameraPose> poses;
  for (const TrainView& view : views) poses.emplace_back(view.view.camera);
  return poses;
}

TEST(StepPose, GoesDownByTheRateAndStaysARotation) {
  CameraPose pose(Views()[0].view.camera);
  const Camera before = pose.Apply(Views()[0].view.camera);
  ASSERT_TRUE(StepPose({0, 5, 0, 0, 0, -3}, 1, 0.01, 2, AdamConstants(), &pose));
  const PoseDifference d = DifferenceOf(before, pose.Apply(before));
  EXPECT_NEAR(d.degrees, 0.01 * 180 / M_PI, 1e-6) << "Adam's first step is as long as its rate";
  EXPECT_NEAR(d.distance, 0.02, 1e-6) << "in units of the extent";
  EXPECT_GT(pose.t[2], before.t[2]) << "against the gradient";
  const CounterRng rng(1, 1);
  for (int i = 2; i < 2000; ++i) {
    const auto at = [&](int k) { return rng.Normal(6 * i + k); };
    ASSERT_TRUE(
        StepPose({at(0), at(1), at(2), at(3), at(4), at(5)}, i, 0.1, 2, AdamConstants(), &pose));
  }
  EXPECT_TRUE(pose.Apply(before).Validate("camera").ok());
  const RowMajor R = Eigen::Map<const RowMajor>(pose.R.data());
  EXPECT_LT((R * R.transpose() - Eigen::Matrix3d::Identity()).norm(), 1e-12);
}

TEST(StepPose, AGradientThatIsNoNumberChangesNothing) {
  for (const double bad :
       {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::infinity()}) {
    CameraPose pose(Views()[0].view.camera);
    EXPECT_FALSE(StepPose({0, bad, 0, 0, 0, 1}, 1, 0.01, 1, AdamConstants(), &pose));
    EXPECT_EQ(pose.R, Views()[0].view.camera.R);
    EXPECT_EQ(pose.t, Views()[0].view.camera.t);
    EXPECT_EQ(pose.moment1, PoseVector());
  }
}

// A turn, a shift and a scale of the world, of some size.
Similarity SomeMove(double turn) {
  Similarity move;
  move.scale = 1.3;
  Eigen::Map<RowMajor>(move.R.data()) =
      Eigen::AngleAxisd(turn, Eigen::Vector3d(1, 2, 3).normalized()).toRotationMatrix();
  move.t = {0.4, -2, 1};
  return move;
}

void ExpectNear(const std::vector<CameraPose>& a, const std::vector<CameraPose>& b) {
  for (size_t i = 0; i < a.size(); ++i) {
    for (int k = 0; k < 9; ++k) EXPECT_NEAR(a[i].R[k], b[i].R[k], 1e-9);
    for (int k = 0; k < 3; ++k) EXPECT_NEAR(a[i].t[k], b[i].t[k], 1e-9);
  }
}

// Cameras that turn about one place.
std::vector<CameraPose> Turning() {
  std::vector<CameraPose> poses = PosesOf(Views());
  for (CameraPose& pose : poses) {
    Eigen::Map<Eigen::Vector3d>(pose.t.data()) =
        -Eigen::Map<const RowMajor>(pose.R.data()) * Eigen::Vector3d(1, 2, 3);
  }
  return poses;
}

TEST(AlignPoses, TakesAMovedWorldBack) {
  const std::vector<CameraPose> given = PosesOf(Views());
  const std::vector<CameraPose> one = {given[0]}, turning = Turning();
  for (const auto& poses : {given, one, turning}) {
    std::vector<CameraPose> moved = poses;
    Splats none;
    Similarity move = SomeMove(2);
    if (poses[0].t != given[0].t || poses.size() == 1) move.scale = 1;  // nothing tells it
    MoveWorld(move, &none, absl::MakeSpan(moved));
    EXPECT_GT(std::abs(moved[0].t[0] - poses[0].t[0]), 0.01);
    MoveWorld(AlignPoses(moved, poses, 4), &none, absl::MakeSpan(moved));
    ExpectNear(moved, poses);
  }
}

TEST(AlignPoses, KeepsTheUnitWhereGivenCamerasAreAtOnePlace) {
  const std::vector<CameraPose> given = Turning();
  for (uint64_t seed = 0; seed < 20; ++seed) {
    const CounterRng rng(seed, 1);
    std::vector<CameraPose> drifted = given;
    for (size_t i = 0; i < drifted.size(); ++i) {
      for (size_t k = 0; k < 3; ++k) drifted[i].t[k] += rng.Uniform(3 * i + k) < 0.5 ? -1e-9 : 1e-9;
    }
    EXPECT_EQ(AlignPoses(drifted, given, /*extent=*/1e-6).scale, 1) << seed;
  }
}

TEST(MoveWorld, KeepsThePictures) {
  Splats splats = ColoredCloud(300, 1);
  std::vector<CameraPose> poses = PosesOf(Views());
  RenderSettings settings;
  settings.num_channels = kColorOnly;
  settings.sh_degree = 0;
  settings.threads = 1;
  Renderer renderer;
  Planes before, after, alpha;
  const Camera& camera = Views()[3].view.camera;
  renderer.Forward(splats, camera, settings, &before, &alpha);
  MoveWorld(SomeMove(2), &splats, absl::MakeSpan(poses));
  renderer.Forward(splats, poses[3].Apply(camera), settings, &after, &alpha);
  double worst = 0;
  for (size_t i = 0; i < before.data.size(); ++i) {
    worst = std::max(worst, double(std::abs(before.data[i] - after.data[i])));
  }
  EXPECT_LT(worst, 1e-3);
}

// The scene as it is, so that cameras alone are learnt.
TrainOptions CamerasAlone() {
  TrainOptions options;
  options.threads = 1;
  options.iterations = 60 * kViews;
  options.sh_degree = 1;
  options.refine_cameras = true;
  Recipe& r = options.recipe;
  r.lita = false;  // the cloud's light is not that of the photos
  r.lr_means = r.lr_sh_dc = r.lr_sh_rest = r.lr_opacity = r.lr_scales = r.lr_quats = 0;
  r.densify_start = r.densify_every = 1000000;
  return options;
}

Splats Scene() { return ColoredCloud(300, 1); }

// Mean distance in the photo, px, of the Gaussians that `camera` sees from where the photo's true
// camera sees those of `truth`. A turn and a shift that look nearly the same count as the same.
double PixelsOff(int view, const Camera& camera, const Splats& splats, const Splats& truth) {
  const auto pixel = [](const Camera& c, const Splats& s, size_t i) {
    const auto p = c.CamFromWorld({s.at(i, kMean), s.at(i, kMean + 1), s.at(i, kMean + 2)});
    return Eigen::Vector2d(c.fx * p[0] / p[2], c.fy * p[1] / p[2]);
  };
  double sum = 0;
  for (size_t i = 0; i < truth.size(); ++i) {
    sum += (pixel(camera, splats, i) - pixel(Views()[view].view.camera, truth, i)).norm();
  }
  return sum / static_cast<double>(truth.size());
}

TEST(RefinedCameras, FindBackToWherePhotosWereTaken) {
  const std::vector<TrainView> shaken = ShakenViews(0.02, 0.05);
  Trainer trainer(CamerasAlone(), &shaken, Scene(), SceneExtent(shaken));
  const Splats truth = trainer.Snapshot().splats;
  const auto pixels_off = [&] {
    const Splats splats = trainer.Snapshot().splats;  // the world is held still
    double sum = 0;
    for (int i = 0; i < kViews; ++i) sum += PixelsOff(i, trainer.CameraOf(i), splats, truth);
    return sum / kViews;
  };
  EXPECT_GT(pixels_off(), 0.6);
  while (trainer.iteration() < CamerasAlone().iterations) ASSERT_TRUE(trainer.Step().ok());
  EXPECT_LT(pixels_off(), 0.2);
}

TEST(RefinedCameras, StayWhereTheGivenOnesWereInTheMean) {
  const std::vector<TrainView> shaken = ShakenViews(0.02, 0.05);
  Trainer trainer(CamerasAlone(), &shaken, Scene(), SceneExtent(shaken));
  while (trainer.iteration() < 5 * kViews) ASSERT_TRUE(trainer.Step().ok());
  std::vector<CameraPose> refined;
  for (int i = 0; i < kViews; ++i) refined.emplace_back(trainer.CameraOf(i));
  const Similarity left = AlignPoses(refined, PosesOf(shaken), SceneExtent(shaken));
  EXPECT_NEAR(left.scale, 1, 1e-5);
  for (int k = 0; k < 3; ++k) EXPECT_NEAR(left.t[k], 0, 1e-5);
  for (int k = 0; k < 9; ++k) EXPECT_NEAR(left.R[k], k % 4 == 0, 1e-5);
  EXPECT_GT(DifferenceOf(trainer.CameraOf(0), shaken[0].view.camera).distance, 1e-3);
}

TEST(RefinedCameras, AreTheSameForAnyThreadCountAndAcrossACheckpoint) {
  const TempDir dir;
  const std::vector<TrainView> shaken = ShakenViews(0.02, 0.05);
  TrainOptions options = CamerasAlone();
  options.recipe.lr_means = 1e-3;
  const auto make = [&] { return Trainer(options, &shaken, Scene(), SceneExtent(shaken)); };
  const auto train = [](Trainer* trainer, int until) {
    while (trainer->iteration() < until) ASSERT_TRUE(trainer->Step().ok());
  };
  Trainer whole = make();
  train(&whole, 11);
  ASSERT_TRUE(whole.SaveCheckpoint(dir / "c", "print").ok());
  train(&whole, 20);
  Trainer resumed = make();
  ASSERT_TRUE(resumed.LoadCheckpoint(dir / "c", "print").ok());
  train(&resumed, 20);
  options.threads = 3;
  Trainer threads = make();
  train(&threads, 20);
  for (const Trainer* other : {&resumed, &threads}) {
    EXPECT_TRUE(SameBytes(other->Snapshot().splats.data(), whole.Snapshot().splats.data()));
    for (int i = 0; i < kViews; ++i) {
      EXPECT_EQ(other->CameraOf(i).Viewmat(), whole.CameraOf(i).Viewmat());
    }
  }
  options.refine_cameras = false;
  EXPECT_EQ(Reason(make().LoadCheckpoint(dir / "c", "print")), "CHECKPOINT_INCONSISTENT");
}

TEST(FitCamera, FindsWhereAPhotoOfAFinishedSceneWasTaken) {
  const TrainOptions options = CamerasAlone();
  Trainer trainer(options, &Views(), Scene(), SceneExtent(Views()));
  const Model model = trainer.Snapshot();
  const std::vector<TrainView> shaken = ShakenViews(0.02, 0.05);
  for (int i = 0; i < kViews; ++i) {
    const auto fitted = FitCamera(options, model, shaken[i], SceneExtent(shaken), CancelToken());
    ASSERT_TRUE(fitted.ok()) << fitted.status();
    EXPECT_TRUE(fitted->finite);
    EXPECT_GT(PixelsOff(i, shaken[i].view.camera, Scene(), Scene()), 0.35);
    EXPECT_LT(PixelsOff(i, fitted->camera, Scene(), Scene()), 0.25);
  }
  CancelToken cancel;
  cancel.Cancel();
  EXPECT_EQ(FitCamera(options, model, shaken[0], SceneExtent(shaken), cancel).status().code(),
            absl::StatusCode::kCancelled);
}

// Two crops a visit, of which the second has a Gaussian whose colour is no number.
TEST(FitCamera, KeepsAndTellsWhatItHadBeforeANumberWasNotFinite) {
  TrainOptions options = CamerasAlone();
  options.recipe.crop_pixels = 64 * 56 / 2;
  const TrainView shaken = ShakenViews(0.02, 0.05)[0];
  const CropGrid grid(64, 56, options.recipe.crop_pixels);
  ASSERT_EQ(grid.columns, 2);
  while (DrawCrop(grid, options.seed, 0, 0).x == 0) ++options.seed;  // the right half comes first
  Model model = Trainer(options, &Views(), Scene(), SceneExtent(Views())).Snapshot();
  const Camera& camera = shaken.view.camera;
  std::vector<std::pair<double, size_t>> columns;
  for (size_t i = 0; i < model.splats.size(); ++i) {
    const auto p = camera.CamFromWorld(
        {model.splats.at(i, kMean), model.splats.at(i, kMean + 1), model.splats.at(i, kMean + 2)});
    columns.emplace_back(camera.fx * p[0] / p[2], i);
  }
  const size_t leftmost = std::min_element(columns.begin(), columns.end())->second;
  model.splats.at(leftmost, kShDc) = std::numeric_limits<float>::quiet_NaN();
  const auto fitted = FitCamera(options, model, shaken, SceneExtent(Views()), CancelToken());
  ASSERT_TRUE(fitted.ok()) << fitted.status();
  EXPECT_FALSE(fitted->finite);
  EXPECT_NE(fitted->camera.t, camera.t);
  EXPECT_TRUE(fitted->camera.Validate("camera").ok());
}

}  // namespace
}  // namespace litags
