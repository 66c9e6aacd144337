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

TEST(Text, NumbersReadWell) {
  EXPECT_EQ(DurationText(0.4), "0s");
  EXPECT_EQ(DurationText(67), "1m07s");
  EXPECT_EQ(DurationText(7500), "2h05m");
  EXPECT_EQ(CountText(0), "0");
  EXPECT_EQ(CountText(999), "999");
  EXPECT_EQ(CountText(1000), "1,000");
  EXPECT_EQ(CountText(-1234567), "-1,234,567");
  EXPECT_EQ(BytesText(999), "999 B");
  EXPECT_EQ(BytesText(3'400'000), "3.4 MB");
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

TEST(Text, ControlCharactersDoNotReachTheTerminal) {
  EXPECT_EQ(Printable("a\x1b[2Jb\nc\x7f"), "a?[2Jb\nc?");
  EXPECT_EQ(Printable("\xc2\x9b"
                      "2J"),
            "?2J");
  EXPECT_EQ(Printable("a\xe2\x80\xaegpj.png \xe2\x80\x8f \xe2\x80\xa8 \xff\xed\xa0\x80"),
            "a?gpj.png ? ? ????");
  EXPECT_EQ(Printable("h\xc3\xb6he"), "h\xc3\xb6he");
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
