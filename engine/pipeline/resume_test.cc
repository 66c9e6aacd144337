// The same scene, byte for byte, however often a job was interrupted.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <opencv2/core/utility.hpp>
#include <string>
#include <utility>
#include <vector>

#include "engine/core/error_test_util.h"
#include "engine/core/rng.h"
#include "engine/core/simd_target.h"
#include "engine/core/simd_test_util.h"
#include "engine/io/container_test_util.h"
#include "engine/io/image_io.h"
#include "engine/io/test_util.h"
#include "engine/pipeline/reconstruct_test_util.h"
#include "engine/train/train_state.h"

namespace litags {
namespace {

namespace fs = std::filesystem;
using ::testing::Contains;
using ::testing::HasSubstr;

// Runs until a report of iteration `iteration` or later, then cancels.
absl::Status ReconstructUntil(int iteration, const ReconstructInput& input,
                              const ReconstructOptions& options) {
  CancelToken cancel;
  Recorder recorder;
  recorder.on_progress = [&](const Progress& p) {
    if (p.iteration >= iteration) cancel.Cancel();
  };
  return MakeEngine(kNoColmap)->Reconstruct(input, options, cancel, &recorder).status();
}

TEST(Reconstruct, GivesTheSameBytesForOneAndTwoThreads) {
  const Photographs photos;
  ReconstructOptions options = SmallOptions();
  options.iterations = 12;
  const ReconstructInput two = photos.Input("two"), one = photos.Input("one"),
                         other = photos.Input("other");
  ASSERT_TRUE(Reconstruct(one, options).ok());
  options.threads = 2;
  ASSERT_TRUE(Reconstruct(two, options).ok());
  EXPECT_TRUE(SceneBytes(one) == SceneBytes(two));
  options.threads = 1;
  options.seed += 1;
  ASSERT_TRUE(Reconstruct(other, options).ok());
  EXPECT_FALSE(SceneBytes(one) == SceneBytes(other)) << "the seed does nothing";
}

// Cancelled at iteration 20, which is between checkpoints: the one that counts is written then.
TEST(Resume, GoesOnAfterACancelAsIfNothingHadHappened) {
  const Photographs photos;
  const ReconstructOptions options = SmallOptions();
  const ReconstructInput whole = photos.Input("whole"), parts = photos.Input("parts");
  ASSERT_TRUE(Reconstruct(whole, options).ok());

  const absl::Status cancelled = ReconstructUntil(20, parts, options);
  EXPECT_EQ(cancelled.code(), absl::StatusCode::kCancelled) << cancelled;
  EXPECT_TRUE(fs::exists(parts.work_dir + "/checkpoint.litags"));
  const auto report = Reconstruct(parts, options);
  ASSERT_TRUE(report.ok()) << report.status();
  EXPECT_THAT(report->notes, Contains("resumed at iteration 20"));
  EXPECT_EQ(report->iterations, kIterations);
  EXPECT_EQ(report->first_iteration, 20);
  EXPECT_THAT(Bytes(parts.work_dir + "/report.json"), HasSubstr("\"first_iteration\": 20,"));
  EXPECT_TRUE(SceneBytes(parts) == SceneBytes(whole));
}

// A crash leaves the checkpoint of iteration 15 and a snapshot of 20.
TEST(Resume, GoesOnFromAnOlderCheckpoint) {
  const Photographs photos;
  const ReconstructOptions options = SmallOptions();
  const ReconstructInput whole = photos.Input("whole"), crashed = photos.Input("crashed");
  const std::string checkpoint = crashed.work_dir + "/checkpoint.litags";
  const std::string kept = checkpoint + ".kept";
  CancelToken cancel;
  Recorder recorder;
  recorder.on_progress = [&](const Progress& p) {
    if (p.iteration < 20) return;
    if (!fs::exists(kept)) fs::copy_file(checkpoint, kept);
    cancel.Cancel();
  };
  ASSERT_TRUE(Reconstruct(whole, options).ok());
  EXPECT_EQ(MakeEngine(kNoColmap)->Reconstruct(crashed, options, cancel, &recorder).status().code(),
            absl::StatusCode::kCancelled);
  ASSERT_TRUE(fs::exists(kept));
  fs::rename(kept, checkpoint);
  const auto report = Reconstruct(crashed, options);
  ASSERT_TRUE(report.ok()) << report.status();
  EXPECT_THAT(report->notes, Contains("resumed at iteration 15"));
  EXPECT_TRUE(SceneBytes(crashed) == SceneBytes(whole));
}

TEST(Resume, CoarseToFineGoesOnAfterACancel) {
  const Photographs photos(/*width=*/160, /*height=*/128);  // 64 px is the smallest side
  ReconstructOptions options = SmallOptions();
  options.recipe->coarse_levels = 1;
  options.recipe->coarse_until = 0.5;
  options.recipe->crop_pixels = 8000;  // two crops at full size
  const ReconstructInput whole = photos.Input("whole"), coarse = photos.Input("coarse"),
                         fine = photos.Input("fine"), flat = photos.Input("flat");
  ASSERT_TRUE(Reconstruct(whole, options).ok());
  for (const auto& [input, iteration] : {std::pair(coarse, 10), std::pair(fine, 30)}) {
    EXPECT_EQ(ReconstructUntil(iteration, input, options).code(), absl::StatusCode::kCancelled);
    ASSERT_TRUE(Reconstruct(input, options).ok());
    EXPECT_TRUE(SceneBytes(input) == SceneBytes(whole)) << "cancelled at " << iteration;
  }
  options.recipe->coarse_levels = 0;
  ASSERT_TRUE(Reconstruct(flat, options).ok());
  EXPECT_FALSE(SceneBytes(flat) == SceneBytes(whole)) << "there was no coarse part";
}

TEST(Resume, SaysThatAnotherInstructionSetGoesOn) {
  const Photographs photos;
  const ReconstructOptions options = SmallOptions();
  std::vector<std::string> targets;
  ForEachTarget([&] {
    targets.push_back(SimdTarget());
    const ReconstructInput input = photos.Input("work");
    if (targets.size() == 1) {
      EXPECT_EQ(ReconstructUntil(20, input, options).code(), absl::StatusCode::kCancelled);
      return;
    }
    const auto report = Reconstruct(input, options);
    ASSERT_TRUE(report.ok()) << report.status();
    const auto changed = HasSubstr(absl::StrCat(targets.front(), ", these with ", targets.back()));
    if (targets.size() == 2) {
      EXPECT_THAT(report->notes, Contains(changed));
    }
  });
  if (targets.size() < 2) GTEST_SKIP() << "this machine has one instruction set";
}

TEST(Resume, SaysOfAllLegsThatOneHadAnotherInstructionSet) {
  const Photographs photos;
  const ReconstructOptions options = SmallOptions();
  const ReconstructInput input = photos.Input("work");
  std::vector<std::string> targets;
  ForEachTarget([&] {
    if (targets.size() == 2) return;
    targets.emplace_back(SimdTarget());
    const int iteration = 10 * static_cast<int>(targets.size());
    EXPECT_EQ(ReconstructUntil(iteration, input, options).code(), absl::StatusCode::kCancelled);
    if (targets.size() < 2) return;
    const auto report = Reconstruct(input, options);
    ASSERT_TRUE(report.ok()) << report.status();
    EXPECT_THAT(report->notes, Contains(HasSubstr(absl::StrCat(targets[0], ", ", targets[1],
                                                               ", these with ", targets[1]))));
  });
  if (targets.size() < 2) GTEST_SKIP() << "this machine has one instruction set";
}

// OpenCV's filters, which targets are made with, then give other last bits.
TEST(Resume, GoesOnWhereOpenCvHasOtherInstructions) {
  const Photographs photos;
  const CounterRng rng(5, 2);
  uint64_t counter = 0;
  for (const View& view : photos.model.views) {
    const std::string path = photos.Photo(view.name);
    absl::StatusOr<ImageU8> photo = ReadImage(path, "images");
    ASSERT_TRUE(photo.ok()) << photo.status();
    for (uint8_t& code : photo->data) {
      code = static_cast<uint8_t>(std::clamp(code / 4.0 + 3 * rng.Normal(counter++), 0.0, 255.0));
    }
    ASSERT_TRUE(WritePng(path, *photo).ok());
  }
  const ReconstructInput input = photos.Input("work");
  const ReconstructOptions options = SmallOptions();
  ASSERT_EQ(ReconstructUntil(20, input, options).code(), absl::StatusCode::kCancelled);
  cv::setUseOptimized(false);
  const auto report = Reconstruct(input, options);
  cv::setUseOptimized(true);
  ASSERT_TRUE(report.ok()) << report.status();
  EXPECT_THAT(report->notes, Contains("resumed at iteration 20"));
}

// Density control first runs at iteration 600, and only in runs of 1200 iterations or more. The
// statistics it goes by are gathered before.
TEST(Resume, GoesOnAcrossDensityControl) {
  const Photographs photos(/*width=*/48, /*height=*/36);
  ReconstructOptions options = SmallOptions();
  options.iterations = 1200;
  options.preview_every = 550;
  options.recipe->pdm.hidden = 2;
  const ReconstructInput whole = photos.Input("whole"), parts = photos.Input("parts");
  const auto report = Reconstruct(whole, options);
  ASSERT_TRUE(report.ok()) << report.status();
  EXPECT_NE(report->gaussians, kPoints) << "there was no density control";
  EXPECT_EQ(ReconstructUntil(550, parts, options).code(), absl::StatusCode::kCancelled);
  const auto resumed = Reconstruct(parts, options);
  ASSERT_TRUE(resumed.ok()) << resumed.status();
  EXPECT_THAT(resumed->notes, Contains("resumed at iteration 550"));
  EXPECT_TRUE(SceneBytes(parts) == SceneBytes(whole));
}

TEST(Resume, StartsAgainFromADamagedCheckpoint) {
  const Photographs photos;
  const ReconstructOptions options = SmallOptions();
  const ReconstructInput whole = photos.Input("whole"), damaged = photos.Input("damaged");
  ASSERT_TRUE(Reconstruct(whole, options).ok());
  const std::string checkpoint = damaged.work_dir + "/checkpoint.litags";
  ASSERT_EQ(ReconstructUntil(20, damaged, options).code(), absl::StatusCode::kCancelled);
  const std::string good = Bytes(checkpoint);
  std::string flipped = good;
  flipped[good.size() / 2] ^= 1;
  for (const std::string& bad : {flipped, good.substr(0, good.size() / 2), std::string("hello")}) {
    ASSERT_TRUE(WriteFileAtomically(checkpoint, bad).ok());
    const auto report = Reconstruct(damaged, options);
    ASSERT_TRUE(report.ok()) << report.status();
    EXPECT_THAT(report->notes, Contains(HasSubstr("the checkpoint could not be used")));
    EXPECT_TRUE(SceneBytes(damaged) == SceneBytes(whole));
  }
}

TEST(Resume, StartsAgainFromACheckpointOfOtherOptions) {
  const Photographs photos;
  ReconstructOptions options = SmallOptions();
  const ReconstructInput whole = photos.Input("whole"), input = photos.Input("work");
  ASSERT_EQ(ReconstructUntil(20, input, options).code(), absl::StatusCode::kCancelled);
  options.recipe->tone.contrast = 0.4;
  ASSERT_TRUE(Reconstruct(whole, options).ok());
  const auto report = Reconstruct(input, options);
  ASSERT_TRUE(report.ok()) << report.status();
  EXPECT_THAT(report->notes, Contains(HasSubstr("a checkpoint of other photos or options")));
  EXPECT_TRUE(SceneBytes(input) == SceneBytes(whole));
}

// What is promised of more iterations: the bytes of a run that had this many, and this schedule,
// from its beginning; whether it had ended, or was stopped.
TEST(Resume, AFinishedSceneIsTrainedFurther) {
  const Photographs photos(/*width=*/160, /*height=*/128);
  ReconstructOptions options = SmallOptions();
  options.recipe->coarse_levels = 1;
  const ReconstructInput ended = photos.Input("ended"), stopped = photos.Input("stopped"),
                         whole = photos.Input("whole"), stretched = photos.Input("stretched");
  ASSERT_TRUE(Reconstruct(ended, options).ok());
  ASSERT_EQ(ReconstructUntil(10, stopped, options).code(), absl::StatusCode::kCancelled);
  options.iterations = kIterations + 15;
  ASSERT_TRUE(Reconstruct(stretched, options).ok());
  options.schedule_iterations = kIterations;
  ASSERT_TRUE(Reconstruct(whole, options).ok());
  EXPECT_FALSE(SceneBytes(whole) == SceneBytes(stretched)) << "the schedules were the same";
  const auto report = Reconstruct(ended, options);
  ASSERT_TRUE(report.ok()) << report.status();
  EXPECT_THAT(report->notes, Contains("resumed at iteration 40"));
  EXPECT_EQ(report->iterations, kIterations + 15);
  EXPECT_TRUE(SceneBytes(ended) == SceneBytes(whole));
  ASSERT_TRUE(Reconstruct(stopped, options).ok());
  EXPECT_TRUE(SceneBytes(stopped) == SceneBytes(whole));
}

// As after a kill between the last checkpoint and the report.
TEST(Resume, AFinishedSceneIsMadeAgainFromItsCheckpoint) {
  const Photographs photos;
  const ReconstructInput input = photos.Input("work");
  const auto first = Reconstruct(input, SmallOptions());
  ASSERT_TRUE(first.ok()) << first.status();
  const std::string scene = SceneBytes(input);
  fs::remove(input.work_dir + "/scene.litags");
  const auto again = Reconstruct(input, SmallOptions());
  ASSERT_TRUE(again.ok()) << again.status();
  EXPECT_THAT(again->notes, Contains("resumed at iteration 40"));
  EXPECT_EQ(again->psnr_holdout, first->psnr_holdout);
  EXPECT_EQ(again->ssim_holdout, first->ssim_holdout);
  EXPECT_EQ(again->gaussians, first->gaussians);
  EXPECT_TRUE(SceneBytes(input) == scene);
}

// A longer run's work is not replaced.
TEST(Resume, RefusesFewerIterationsThanThereWere) {
  const Photographs photos;
  ReconstructOptions options = SmallOptions();
  const ReconstructInput input = photos.Input("work");
  const std::string checkpoint = input.work_dir + "/checkpoint.litags";
  ASSERT_TRUE(Reconstruct(input, options).ok());
  const std::string good = Bytes(checkpoint), scene = SceneBytes(input);
  options.iterations = 20;
  options.schedule_iterations = kIterations;
  const absl::Status status = Reconstruct(input, options).status();
  EXPECT_EQ(Reason(status), "CHECKPOINT_TOO_LONG");
  EXPECT_THAT(std::string(status.message()), HasSubstr("has 40 iterations, more than the 20"));
  EXPECT_TRUE(Bytes(checkpoint) == good);
  EXPECT_TRUE(SceneBytes(input) == scene);
}

TEST(Resume, RefusesACheckpointOfANewerProgram) {
  const Photographs photos;
  const ReconstructOptions options = SmallOptions();
  const ReconstructInput input = photos.Input("work");
  const std::string checkpoint = input.work_dir + "/checkpoint.litags";
  ASSERT_EQ(ReconstructUntil(20, input, options).code(), absl::StatusCode::kCancelled);
  RewriteAsVersion(checkpoint, "checkpoint", kCheckpointVersion + 1);
  const std::string newer = Bytes(checkpoint);
  const absl::Status status = Reconstruct(input, options).status();
  EXPECT_EQ(Reason(status), "CONTAINER_TOO_NEW");
  EXPECT_THAT(std::string(status.message()), HasSubstr("update litags"));
  EXPECT_TRUE(Bytes(checkpoint) == newer);
}

TEST(Resume, StartsAgainFromACheckpointOfAnOlderProgram) {
  const Photographs photos;
  const ReconstructOptions options = SmallOptions();
  const ReconstructInput input = photos.Input("work");
  ASSERT_EQ(ReconstructUntil(20, input, options).code(), absl::StatusCode::kCancelled);
  RewriteAsVersion(input.work_dir + "/checkpoint.litags", "checkpoint", 1);
  const auto report = Reconstruct(input, options);
  ASSERT_TRUE(report.ok()) << report.status();
  EXPECT_EQ(report->first_iteration, 0);
  EXPECT_THAT(report->notes, Contains(HasSubstr("checkpoint version 1 is older than ")));
}

TEST(Resume, SaysThatAnEarlierRunLeftNoCheckpoint) {
  const Photographs photos;
  const ReconstructInput input = photos.Input("work");
  ASSERT_TRUE(Reconstruct(input, SmallOptions()).ok());
  const std::string scene = SceneBytes(input);
  fs::remove(input.work_dir + "/checkpoint.litags");
  const auto report = Reconstruct(input, SmallOptions());
  ASSERT_TRUE(report.ok()) << report.status();
  EXPECT_THAT(report->notes, Contains(HasSubstr("left no checkpoint")));
  EXPECT_TRUE(SceneBytes(input) == scene);
}

// Points are not seen in a resumed run, but the checkpoint grew from them.
TEST(Resume, StartsAgainFromACheckpointOfOtherPoints) {
  Photographs photos;
  const ReconstructOptions options = SmallOptions();
  const ReconstructInput whole = photos.Input("whole"), input = photos.Input("work");
  ASSERT_EQ(ReconstructUntil(20, input, options).code(), absl::StatusCode::kCancelled);
  for (SparsePoint& point : photos.model.points) point.xyz[1] += 0.1;
  photos.WriteModel();
  ASSERT_TRUE(Reconstruct(whole, options).ok());
  const auto report = Reconstruct(input, options);
  ASSERT_TRUE(report.ok()) << report.status();
  EXPECT_THAT(report->notes, Contains(HasSubstr("a checkpoint of other photos or options")));
  EXPECT_TRUE(SceneBytes(input) == SceneBytes(whole));
}

TEST(Resume, CancelBeforeTheStartLeavesNoScene) {
  const Photographs photos;
  const ReconstructInput input = photos.Input("work");
  CancelToken cancel;
  cancel.Cancel();
  Recorder recorder;
  const auto report = MakeEngine(kNoColmap)->Reconstruct(input, SmallOptions(), cancel, &recorder);
  EXPECT_EQ(report.status().code(), absl::StatusCode::kCancelled);
  EXPECT_FALSE(fs::exists(input.work_dir + "/scene.litags"));
}

}  // namespace
}  // namespace litags
