// Workers that are not heard of any more, and clocks that jump.
#include <gmock/gmock.h>

#include "absl/strings/str_cat.h"
#include "engine/core/error_test_util.h"
#include "server/jobs/jobs_test_util.h"
#include "server/testing/no_room.h"

namespace litags {
namespace {

using ::testing::HasSubstr;

// Beside the clock that the test sets, one that nobody sets.
class LostWorkers : public JobsTest {
 protected:
  void SetClock(int64_t by_ms) {
    now_ms_ += by_ms;
    set_ms_ += by_ms;
  }

  int64_t set_ms_ = 0;
  Leases leases_{store_.get(), blobs_.get(), {}, clock_, [this] { return now_ms_ - set_ms_; }};
};

TEST_F(LostWorkers, SilentWorkerLosesTheJobAndCanWriteNothingMore) {
  const std::string id = StartedJob();
  const Lease first = **leases_.Acquire("w1");
  now_ms_ += 9'000;
  ASSERT_TRUE(leases_.Heartbeat(first, 0).ok());
  now_ms_ += 9'000;
  EXPECT_FALSE(leases_.Acquire("w2")->has_value());
  now_ms_ += 2'000;
  const auto second = leases_.Acquire("w2");
  ASSERT_TRUE(second.ok() && second->has_value());
  EXPECT_EQ((*second)->job.id, id);
  EXPECT_EQ((*second)->job.attempt, 2);
  EXPECT_EQ(Reason(leases_.Heartbeat(first, 0).status()), "LEASE_LOST");
  EXPECT_EQ(Reason(leases_.CancelRequested(first).status()), "LEASE_LOST");
  EXPECT_EQ(Reason(leases_.AddProgress(first, {})), "LEASE_LOST");
  EXPECT_EQ(Reason(leases_.Succeed(first, {}, {})), "LEASE_LOST");
  EXPECT_TRUE(leases_.AddProgress(**second, {}).ok());
  EXPECT_EQ(History(id), "UPLOADING QUEUED RUNNING QUEUED RUNNING ");
}

TEST_F(LostWorkers, JobsAreTakenBackAlsoWhereNoOtherWorkerLooksForWork) {
  const std::string waits = StartedJob(), cancelled = StartedJob();
  ASSERT_TRUE(leases_.Acquire("w1")->has_value());
  ASSERT_TRUE(leases_.Acquire("w2")->has_value());
  ASSERT_TRUE(jobs_.Cancel(cancelled).ok());
  now_ms_ += 9'000;
  ASSERT_TRUE(leases_.TakeBackLost().ok());
  EXPECT_EQ(State(waits), JobState::kRunning);
  EXPECT_EQ(State(cancelled), JobState::kRunning);
  now_ms_ += 2'000;
  ASSERT_TRUE(leases_.TakeBackLost().ok());
  EXPECT_EQ(State(waits), JobState::kQueued);
  EXPECT_EQ(State(cancelled), JobState::kCancelled);
  EXPECT_TRUE(store_->Queue()->running.empty());
}

TEST_F(LostWorkers, ClockSetBackNeitherKeepsADeadWorkersJobNorTakesALivingOnes) {
  const std::string dead = StartedJob();
  ASSERT_TRUE(leases_.Acquire("dead")->has_value());
  const std::string living = StartedJob();
  const Lease lease = **leases_.Acquire("living");
  SetClock(-600'000);
  EXPECT_FALSE(leases_.Acquire("idle")->has_value());
  now_ms_ += 9'000;
  ASSERT_TRUE(leases_.Heartbeat(lease, 0).ok());
  now_ms_ += 2'000;
  const auto taken = leases_.Acquire("idle");
  ASSERT_TRUE(taken.ok() && taken->has_value());
  EXPECT_EQ((*taken)->job.id, dead);
  ASSERT_TRUE(leases_.Succeed(**taken, {}, kScene).ok());
  ASSERT_TRUE(leases_.Succeed(lease, {}, kScene).ok());
  // Earlier times, but the same order of events.
  EXPECT_EQ(History(dead), "UPLOADING QUEUED RUNNING QUEUED RUNNING SUCCEEDED ");
  EXPECT_EQ(History(living), "UPLOADING QUEUED RUNNING SUCCEEDED ");
}

// A machine that wakes up sees the same.
TEST_F(LostWorkers, ClockSetForwardTakesNoJobFromALivingWorkerAndADeadOnesALeaseLater) {
  const std::string living = StartedJob();
  const Lease lease = **leases_.Acquire("living");
  const std::string dead = StartedJob();
  ASSERT_TRUE(leases_.Acquire("dead")->has_value());
  SetClock(3'600'000);
  EXPECT_FALSE(leases_.Acquire("idle")->has_value());
  now_ms_ += 9'000;
  EXPECT_FALSE(leases_.Acquire("idle")->has_value());
  ASSERT_TRUE(leases_.Heartbeat(lease, 0).ok());
  now_ms_ += 1'000;
  EXPECT_EQ(leases_.Acquire("idle")->value().job.id, dead);
  EXPECT_TRUE(leases_.Succeed(lease, {}, kScene).ok());
  EXPECT_EQ(History(living), "UPLOADING QUEUED RUNNING SUCCEEDED ");
}

// The database was away, and the worker that starts is the first one back.
TEST_F(LostWorkers, WorkerThatStartsTakesNoJobWhoseWorkerHadNoTimeToRenew) {
  StartedJob();
  ASSERT_TRUE(leases_.Acquire("w1")->has_value());
  now_ms_ += 20'000;
  Leases starting(store_.get(), blobs_.get(), {}, clock_);
  EXPECT_FALSE(starting.Acquire("w2")->has_value());
  now_ms_ += 10'000;
  EXPECT_TRUE(starting.Acquire("w2")->has_value());
}

TEST_F(LostWorkers, JobFailsWithItsReasonAfterThreeLostWorkers) {
  const std::string id = StartedJob();
  for (int attempt = 1; attempt <= 3; ++attempt) {
    EXPECT_EQ(State(id), JobState::kQueued);
    ASSERT_TRUE(leases_.Acquire("w")->has_value());
    ASSERT_TRUE(leases_.WorkerDied("w", "killed by signal 9").ok());
  }
  const JobRecord job = *jobs_.Get(id);
  EXPECT_EQ(job.state, JobState::kFailed);
  const auto error = Decode<JobError>(job.error);
  EXPECT_EQ(error->code, absl::StatusCode::kAborted);
  EXPECT_EQ(error->detail.reason, "WORKER_LOST");
  EXPECT_THAT(error->message, HasSubstr("killed by signal 9"));
  // A resumed job has all its attempts again and no old error.
  ASSERT_TRUE(jobs_.Resume(id).ok());
  EXPECT_EQ(jobs_.Get(id)->attempt, 0);
  EXPECT_EQ(jobs_.Get(id)->error, "");
}

TEST_F(LostWorkers, WorkerThatShutsDownCostsNoAttempt) {
  const std::string id = StartedJob();
  for (int i = 0; i < 5; ++i) {
    const Lease lease = **leases_.Acquire(absl::StrCat("w", i));
    EXPECT_EQ(lease.job.attempt, 1);
    ASSERT_TRUE(leases_.GiveBack(lease, 0).ok());
    EXPECT_EQ(State(id), JobState::kQueued);
  }
}

TEST_F(LostWorkers, JobThatLostItsWorkerKeepsItsPlaceInTheQueue) {
  const std::string first = StartedJob();
  now_ms_ += 1000;
  const std::string second = StartedJob();
  ASSERT_TRUE(leases_.Acquire("w")->has_value());
  now_ms_ += 1000;
  ASSERT_TRUE(leases_.WorkerDied("w", "gone").ok());
  EXPECT_EQ((*leases_.Acquire("w2"))->job.id, first);
  EXPECT_EQ((*leases_.Acquire("w3"))->job.id, second);
}

TEST_F(LostWorkers, RunTimeIsWhatWorkersToldWhateverTheClockSays) {
  const std::string id = StartedJob();
  const Lease slept = **leases_.Acquire("w");
  now_ms_ += 100'000'000;  // the machine sleeps for a day
  ASSERT_TRUE(leases_.Heartbeat(slept, 2000).ok());
  ASSERT_TRUE(leases_.GiveBack(slept, 3000).ok());
  EXPECT_EQ(jobs_.Get(id)->run_ms, 3000);
  const Lease lost = **leases_.Acquire("w2");
  ASSERT_TRUE(leases_.Heartbeat(lost, 4000).ok());
  now_ms_ += 100'000'000;  // all is down for a day
  ASSERT_TRUE(leases_.Acquire("w3")->has_value());
  EXPECT_EQ(jobs_.Get(id)->run_ms, 7000);
}

TEST_F(LostWorkers, NoJobIsTakenFromItsWorkerByOneThatCouldNotWriteEither) {
  const std::string id = StartedJob();
  ASSERT_TRUE(leases_.Acquire("living")->has_value());
  now_ms_ += 20'000;
  {
    const NoRoom no_room;
    EXPECT_FALSE(leases_.Acquire("idle").ok());
  }
  const auto taken = leases_.Acquire("idle");
  ASSERT_TRUE(taken.ok()) << taken.status();
  EXPECT_FALSE(taken->has_value());
  EXPECT_EQ(jobs_.Get(id)->lease_owner, "living");
}

TEST_F(LostWorkers, LostWorkerOfAJobToBeCancelledCancelsIt) {
  const std::string id = StartedJob();
  ASSERT_TRUE(leases_.Acquire("w")->has_value());
  ASSERT_TRUE(jobs_.Cancel(id).ok());
  ASSERT_TRUE(leases_.WorkerDied("w", "gone").ok());
  EXPECT_EQ(State(id), JobState::kCancelled);
}

}  // namespace
}  // namespace litags
