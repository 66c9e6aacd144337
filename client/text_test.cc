#include "client/text.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace litags::client {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

v1::JobEvent TrainingEvent() {
  v1::JobEvent event;
  event.set_number(12);
  v1::Progress* progress = event.mutable_progress();
  progress->set_stage(v1::STAGE_TRAINING);
  progress->set_iteration(250);
  progress->set_iterations(1000);
  progress->set_loss(0.08123);
  progress->set_gaussians(5123);
  progress->set_iterations_per_second(41.23);
  progress->mutable_eta()->set_seconds(67);
  return event;
}

TEST(Text, AnEventIsOnePlainLine) {
  EXPECT_EQ(EventLine(TrainingEvent()),
            "#12 training  250/1000  loss 0.0812  5,123 Gaussians  41.2 it/s  ETA 1m07s");
}

TEST(Text, AFailureSaysWhyOnItsLine) {
  v1::JobEvent event;
  event.set_number(3);
  event.mutable_state_change()->set_state(v1::JOB_STATE_FAILED);
  event.mutable_state_change()->mutable_error()->set_message("too dark\nadd photos");
  EXPECT_EQ(EventLine(event), "#3 failed: too dark add photos");
}

TEST(Text, AQueuedJobIsNotCalledStarted) {
  v1::JobEvent event;
  event.set_number(2);
  event.mutable_state_change()->set_state(v1::JOB_STATE_QUEUED);
  event.mutable_state_change()->set_message("started");
  EXPECT_EQ(EventLine(event), "#2 queued");
  event.mutable_state_change()->set_message("resumed");
  EXPECT_EQ(EventLine(event), "#2 queued: resumed");
}

TEST(Text, TheProgressLineNeverExceedsItsWidth) {
  const v1::JobEvent event = TrainingEvent();
  for (size_t columns = 0; columns < 200; ++columns) {
    EXPECT_LE(ProgressLine(event.progress(), columns).size(), columns);
  }
}

TEST(Text, TheBarIsFilledAsFarAsTheJobIs) {
  const std::string wide = ProgressLine(TrainingEvent().progress(), 120);
  EXPECT_THAT(wide, HasSubstr("[=======                       ]"));  // 7 of 30
  EXPECT_THAT(wide, HasSubstr("ETA 1m07s"));
  EXPECT_THAT(ProgressLine(TrainingEvent().progress(), 40), Not(HasSubstr("[")));
}

TEST(Text, TheOutcomeOfAFailureNamesFieldAndReason) {
  v1::Job job;
  job.set_name("jobs/1");
  job.set_state(v1::JOB_STATE_FAILED);
  job.mutable_error()->set_message("cameras for 6 of 40 photos; add photos");
  job.mutable_error()->mutable_detail()->set_field("images");
  job.mutable_error()->mutable_detail()->set_reason("SFM_TOO_FEW_VIEWS");
  EXPECT_EQ(OutcomeText(job),
            "jobs/1 failed: cameras for 6 of 40 photos; add photos\n"
            "  field:  images\n"
            "  reason: SFM_TOO_FEW_VIEWS\n");
  job.set_state(v1::JOB_STATE_CANCELLED);
  job.mutable_report()->set_iterations(40);
  EXPECT_EQ(OutcomeText(job),
            "jobs/1 is cancelled\n  the finished scene of 40 iterations is still there\n");
}

}  // namespace
}  // namespace litags::client
