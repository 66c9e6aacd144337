#include "client/report/course.h"

#include <gtest/gtest.h>

#include <optional>

namespace litags::report {
namespace {

v1::JobEvent EventAt(int64_t seconds) {
  v1::JobEvent event;
  event.mutable_time()->set_seconds(1'000'000 + seconds);
  return event;
}

v1::JobEvent StateAt(int64_t seconds, v1::JobState state) {
  v1::JobEvent event = EventAt(seconds);
  event.mutable_state_change()->set_state(state);
  return event;
}

v1::JobEvent ProgressAt(int64_t seconds, v1::Stage stage, int iteration = 0, double loss = 0,
                        std::optional<double> psnr = {}) {
  v1::JobEvent event = EventAt(seconds);
  v1::Progress* progress = event.mutable_progress();
  progress->set_stage(stage);
  progress->set_iteration(iteration);
  progress->set_loss(loss);
  if (psnr) progress->set_psnr_holdout(*psnr);
  return event;
}

double SecondsIn(const Course& course, const std::string& stage) {
  for (const StageTime& time : course.stages()) {
    if (time.name == stage) return time.seconds;
  }
  return -1;
}

TEST(Course, EachStageHasTheTimeUntilTheNextOne) {
  Course course;
  course.Add(StateAt(0, v1::JOB_STATE_UPLOADING));
  course.Add(StateAt(50, v1::JOB_STATE_QUEUED));
  course.Add(StateAt(57, v1::JOB_STATE_RUNNING));
  course.Add(ProgressAt(57, v1::STAGE_FINDING_CAMERAS));
  course.Add(ProgressAt(80, v1::STAGE_FINDING_CAMERAS));
  course.Add(ProgressAt(90, v1::STAGE_TRAINING));
  course.Add(StateAt(190, v1::JOB_STATE_SUCCEEDED));
  ASSERT_EQ(course.stages().size(), 3u);  // not the upload
  EXPECT_EQ(course.stages()[0].name, "queued");
  EXPECT_EQ(SecondsIn(course, "queued"), 7);
  EXPECT_EQ(SecondsIn(course, "finding-cameras"), 33);
  EXPECT_EQ(SecondsIn(course, "training"), 100);
}

TEST(Course, AJobThatGoesOnReplacesWhatCameAfterItsCheckpoint) {
  Course course;
  course.Add(StateAt(0, v1::JOB_STATE_RUNNING));
  course.Add(ProgressAt(10, v1::STAGE_TRAINING, 100, 0.5));
  course.Add(ProgressAt(20, v1::STAGE_TRAINING, 200, 0.4));
  course.Add(StateAt(25, v1::JOB_STATE_CANCELLED));
  course.Add(StateAt(1000, v1::JOB_STATE_QUEUED));
  course.Add(StateAt(1010, v1::JOB_STATE_RUNNING));
  course.Add(ProgressAt(1020, v1::STAGE_TRAINING, 150, 0.3));
  ASSERT_EQ(course.loss().size(), 2u);
  EXPECT_EQ(course.loss()[1].iteration, 150);
  EXPECT_EQ(course.loss()[1].value, 0.3);
  // Time between the runs is no time of the job's.
  EXPECT_EQ(course.loss()[1].seconds, 25 + 10);
}

TEST(Course, ValuesThatAreNotKnownYetAreNoPoints) {
  Course course;
  course.Add(ProgressAt(0, v1::STAGE_LOADING));
  course.Add(ProgressAt(1, v1::STAGE_TRAINING, 10, 0.5));
  course.Add(ProgressAt(2, v1::STAGE_TRAINING, 20, 0.4, 21.5));
  course.Add(ProgressAt(3, v1::STAGE_TRAINING, 30, 0.3, 21.5));  // not measured again
  EXPECT_EQ(course.loss().size(), 3u);
  ASSERT_EQ(course.psnr().size(), 1u);
  EXPECT_EQ(course.psnr()[0].iteration, 20);
  EXPECT_EQ(course.psnr()[0].value, 21.5);
}

TEST(Course, AClockThatIsBehindTakesNoTimeAway) {
  Course course;
  course.Add(StateAt(100, v1::JOB_STATE_QUEUED));
  course.Add(StateAt(90, v1::JOB_STATE_RUNNING));
  EXPECT_EQ(SecondsIn(course, "queued"), 0);
}

}  // namespace
}  // namespace litags::report
