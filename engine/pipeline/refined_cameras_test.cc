// ReconstructOptions::refine_cameras, from photos to the scene's cameras.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "engine/pipeline/held_out_photos.h"
#include "engine/pipeline/reconstruct_test_util.h"

namespace litags {
namespace {

using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

// Photos whose given cameras stand a few hundredths off.
class OffPhotographs : public Photographs {
 public:
  OffPhotographs() {
    for (size_t i = 0; i < model.views.size(); ++i) {
      model.views[i].camera.t[i % 3] += 0.04;
    }
    WriteModel();
  }
};

ReconstructOptions Refining() {
  ReconstructOptions options = SmallOptions();
  options.refine_cameras = true;
  return options;
}

std::vector<View> SceneViews(const ReconstructInput& input) {
  const auto scene = MakeEngine(kNoColmap)->LoadScene(input.work_dir + "/scene.litags");
  EXPECT_TRUE(scene.ok()) << scene.status();
  return scene.ok() ? (*scene)->views() : std::vector<View>();
}

TEST(RefineCameras, TheSceneHasTheRefinedCamerasAndTheReportSaysHowFarTheyMoved) {
  const OffPhotographs photos;
  const ReconstructInput given = photos.Input("given"), refined = photos.Input("refined");
  const auto without = Reconstruct(given, SmallOptions());
  ASSERT_TRUE(without.ok()) << without.status();
  EXPECT_THAT(without->notes, Not(Contains(HasSubstr("cameras were refined"))));
  const auto with = Reconstruct(refined, Refining());
  ASSERT_TRUE(with.ok()) << with.status();
  EXPECT_THAT(with->notes, Contains(HasSubstr("cameras were refined: turned by")));

  const std::vector<View> before = SceneViews(given), after = SceneViews(refined);
  ASSERT_EQ(before.size(), size_t{kPhotos});
  ASSERT_EQ(after.size(), before.size());
  for (size_t i = 0; i < before.size(); ++i) {
    EXPECT_EQ(after[i].name, before[i].name);
    EXPECT_NE(after[i].camera.t, before[i].camera.t) << before[i].name << ", held out or not";
  }
  EXPECT_TRUE(std::isfinite(with->psnr_holdout));
}

bool Placing(const Progress& p) { return absl::StartsWith(p.message, "placing held-out photos"); }

// Until they are fitted at the end, the cameras of held-out photos are not where the others are.
TEST(RefineCameras, HeldOutPhotosAreMeasuredAtTheEnd) {
  const OffPhotographs photos;
  Recorder recorder;
  const auto report = MakeEngine(kNoColmap)->Reconstruct(photos.Input("work"), Refining(),
                                                         CancelToken(), &recorder);
  ASSERT_TRUE(report.ok()) << report.status();
  ASSERT_FALSE(recorder.reports.empty());
  EXPECT_EQ(recorder.reports.back().iteration, kIterations);
  for (const Progress& p : recorder.reports) {
    EXPECT_EQ(std::isfinite(p.psnr_holdout), p.iteration == kIterations && !Placing(p))
        << p.iteration << " " << p.message;
  }
}

TEST(RefineCameras, AResumedRunGivesTheSameBytes) {
  const OffPhotographs photos;
  const ReconstructInput whole = photos.Input("whole"), parts = photos.Input("parts");
  const auto report = Reconstruct(whole, Refining());
  ASSERT_TRUE(report.ok()) << report.status();
  CancelToken cancel;
  Recorder recorder;
  recorder.on_progress = [&](const Progress& p) {
    if (p.iteration >= 20) cancel.Cancel();
  };
  EXPECT_EQ(
      MakeEngine(kNoColmap)->Reconstruct(parts, Refining(), cancel, &recorder).status().code(),
      absl::StatusCode::kCancelled);
  const auto resumed = Reconstruct(parts, Refining());
  ASSERT_TRUE(resumed.ok()) << resumed.status();
  EXPECT_THAT(resumed->notes, Contains("resumed at iteration 20"));
  EXPECT_TRUE(SceneBytes(parts) == SceneBytes(whole));
  EXPECT_EQ(resumed->psnr_holdout, report->psnr_holdout);
}

// Placing held-out photos takes 150 steps each, after the last iteration.
TEST(RefineCameras, PlacingHeldOutPhotosCanBeCancelledAndResumed) {
  const OffPhotographs photos;
  const ReconstructInput whole = photos.Input("whole"), parts = photos.Input("parts");
  const auto report = Reconstruct(whole, Refining());
  ASSERT_TRUE(report.ok()) << report.status();
  CancelToken cancel;
  Recorder recorder;
  recorder.on_progress = [&](const Progress& p) {
    if (Placing(p)) cancel.Cancel();
  };
  EXPECT_EQ(
      MakeEngine(kNoColmap)->Reconstruct(parts, Refining(), cancel, &recorder).status().code(),
      absl::StatusCode::kCancelled);
  ASSERT_FALSE(recorder.reports.empty());
  EXPECT_EQ(recorder.reports.back().message, "placing held-out photos: 0 of 2");
  const auto resumed = Reconstruct(parts, Refining());
  ASSERT_TRUE(resumed.ok()) << resumed.status();
  EXPECT_TRUE(SceneBytes(parts) == SceneBytes(whole));
  EXPECT_EQ(resumed->psnr_holdout, report->psnr_holdout);
}

TEST(RefineCameras, TheTimeLeftCountsPlacingHeldOutPhotos) {
  const OffPhotographs photos;
  // The time left at iteration 20 of 30, in iterations.
  const auto iterations_left = [&](int holdout_every) {
    ReconstructOptions options = Refining();
    options.holdout_every = holdout_every;
    Recorder recorder;
    const auto report = MakeEngine(kNoColmap)->Reconstruct(
        photos.Input(absl::StrCat("run", holdout_every)), options, CancelToken(), &recorder);
    EXPECT_TRUE(report.ok()) << report.status();
    double left = 0;
    for (const Progress& p : recorder.reports) {
      if (p.iteration == 20) left = p.eta_seconds * p.iterations_per_second;
    }
    return left;
  };
  EXPECT_LT(iterations_left(0), 40);
  EXPECT_GT(iterations_left(4), 60) << "two photos of 150 steps";
}

TEST(HeldOutPhotos, NamesThoseThatCouldNotBePlacedToTheEnd) {
  const Splats splats = ColoredCloud(kPoints, 3);
  const std::vector<TrainView> views = DarkViews(splats, 2, kWidth, kHeight);
  Model model;
  model.lita = false;
  model.splats = splats;
  for (size_t i = 0; i < splats.size(); ++i) {
    model.splats.at(i, kShDc) = std::numeric_limits<float>::quiet_NaN();
  }
  TrainOptions options;
  options.recipe = Plain3dgs();
  options.threads = 1;
  HeldOutPhotos held_out(&views, 1);
  std::vector<std::string> notes;
  ASSERT_TRUE(held_out
                  .FitCameras(
                      options, model, 1, [](size_t) {}, CancelToken(), &notes)
                  .ok());
  EXPECT_THAT(notes, ElementsAre(HasSubstr("not finite: photo0.png, photo1.png")));
}

}  // namespace
}  // namespace litags
