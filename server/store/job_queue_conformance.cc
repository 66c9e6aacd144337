// What the queue of every job store must do, whatever keeps it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "absl/strings/str_cat.h"
#include "server/store/job_store.h"
#include "server/testing/job_store_kind.h"

namespace litags {
namespace {

using ::testing::ElementsAre;

class JobQueueConformance : public StoreConformance {};

TEST_F(JobQueueConformance, TheQueueIsReadByPriorityThenTime) {
  const auto add = [&](const std::string& id, JobState state, int priority) {
    JobRecord job = MakeJob(id, 10, state);
    job.owner = "alice";
    job.priority = priority;
    ASSERT_TRUE(store_->Create(job, Nothing).ok());
  };
  add("c", JobState::kQueued, 0);
  add("b", JobState::kQueued, 0);
  add("a", JobState::kQueued, -1);
  add("d", JobState::kRunning, 0);
  const auto queue = store_->Queue();
  ASSERT_TRUE(queue.ok()) << queue.status();
  std::vector<std::string> ids;
  for (const JobQueue::Job& job : queue->waiting) ids.push_back(job.id);
  EXPECT_THAT(ids, ElementsAre("b", "c", "a"));
  EXPECT_EQ(queue->waiting[2].priority, -1);
  EXPECT_EQ(queue->waiting[2].owner, "alice");
  EXPECT_EQ(queue->running, (std::map<std::string, int64_t>{{"alice", 1}}));
}

TEST_F(JobQueueConformance, QueueIsFirstInFirstOutAndExpiryLooksAtTheLeaseOnly) {
  ASSERT_TRUE(store_->Create(MakeJob("late", 20, JobState::kQueued), Nothing).ok());
  ASSERT_TRUE(store_->Create(MakeJob("early", 10, JobState::kQueued), Nothing).ok());
  const auto take = [](JobTransaction& job) {
    job.job.state = JobState::kRunning;
    job.job.lease_owner = std::string("w");
    job.job.lease_expires_ms = 100;
    return absl::OkStatus();
  };
  EXPECT_EQ((*store_->UpdateFirstQueued(FitsAny, take))->id, "early");
  EXPECT_EQ((*store_->UpdateFirstQueued(FitsAny, take))->id, "late");
  EXPECT_FALSE(store_->UpdateFirstQueued(FitsAny, take)->has_value());
  EXPECT_FALSE(store_->UpdateFirstExpired(100, Nothing)->has_value());
  EXPECT_TRUE(store_->UpdateFirstExpired(101, Nothing)->has_value());
  EXPECT_FALSE(store_->UpdateFirstLeasedBeyond(100, Nothing)->has_value());
  EXPECT_TRUE(store_->UpdateFirstLeasedBeyond(99, Nothing)->has_value());
  EXPECT_EQ(store_->LeasedTo("w")->size(), 2u);
  EXPECT_TRUE(store_->LeasedTo("other")->empty());
}

TEST_F(JobQueueConformance, QueueIsSharedOutAmongOwnersWithinAPriority) {
  const auto queue = [&](const std::string& id, const std::string& owner, int64_t time_ms,
                         int priority = 0) {
    JobRecord job = MakeJob(id, time_ms, JobState::kQueued);
    job.owner = owner;
    job.priority = priority;
    ASSERT_TRUE(store_->Create(job, Nothing).ok());
  };
  for (int i = 1; i <= 5; ++i) queue(absl::StrCat("many", i), "many", i);
  queue("one1", "one", 10);
  queue("two1", "two", 20);
  queue("two2", "two", 21);
  queue("urgent1", "many", 30, 1);
  std::string taken;
  const auto take = [&] {
    const auto job = store_->UpdateFirstQueued(FitsAny, [](JobTransaction& job) {
      job.job.state = JobState::kRunning;
      return absl::OkStatus();
    });
    ASSERT_TRUE(job.ok()) << job.status();
    absl::StrAppend(&taken, *job ? (*job)->id : "none", " ");
  };
  for (int i = 0; i < 6; ++i) take();
  // A job of another priority counts, too; then those with the fewest go first, then the longest
  // wait.
  EXPECT_EQ(taken, "urgent1 one1 two1 many1 two2 many2 ");
  // Whoever has none running any more is first again.
  taken.clear();
  queue("one2", "one", 40);
  ASSERT_TRUE(store_
                  ->Update("one1",
                           [](JobTransaction& job) {
                             job.job.state = JobState::kSucceeded;
                             return absl::OkStatus();
                           })
                  .ok());
  for (int i = 0; i < 5; ++i) take();
  EXPECT_EQ(taken, "one2 many3 many4 many5 none ");
}

TEST_F(JobQueueConformance, JobThatDoesNotFitIsPassedOverAndKeepsItsPlace) {
  const auto queue = [&](const std::string& id, const std::string& needs, int64_t time_ms,
                         int priority = 0) {
    JobRecord job = MakeJob(id, time_ms, JobState::kQueued);
    job.needs = needs;
    job.priority = priority;
    ASSERT_TRUE(store_->Create(job, Nothing).ok());
  };
  queue("small1", "", 1);
  queue("large1", "large", 2, 1);
  queue("large2", "large", 3, 1);
  queue("odd1", "odd", 4);
  const auto take = [&](JobStore::Fits fits) {
    const auto job = store_->UpdateFirstQueued(fits, [](JobTransaction& job) {
      job.job.state = JobState::kRunning;
      return absl::OkStatus();
    });
    EXPECT_TRUE(job.ok()) << job.status();
    return *job ? (*job)->id : "none";
  };
  const auto small = [](std::string_view needs) { return needs.empty(); };
  EXPECT_EQ(take(small), "small1");
  EXPECT_EQ(take(small), "none");
  EXPECT_EQ(take([](std::string_view needs) { return needs != "odd"; }), "large1");
  EXPECT_EQ(take(FitsAny), "large2");
  EXPECT_EQ(take(FitsAny), "odd1");
  EXPECT_EQ(store_->Get("odd1")->needs, "odd");
}

TEST_F(JobQueueConformance, CensusCountsStatesAndFindsTheLongestWait) {
  EXPECT_TRUE(store_->Census()->by_state.empty());
  EXPECT_EQ(store_->Census()->oldest_queue_time_ms, 0);
  ASSERT_TRUE(store_->Create(MakeJob("u", 5), Nothing).ok());
  ASSERT_TRUE(store_->Create(MakeJob("q2", 20, JobState::kQueued), Nothing).ok());
  ASSERT_TRUE(store_->Create(MakeJob("q1", 10, JobState::kQueued), Nothing).ok());
  JobRecord running = MakeJob("r", 1, JobState::kRunning);
  running.progress = "{}";
  ASSERT_TRUE(store_->Create(running, Nothing).ok());
  const JobCensus census = *store_->Census();
  EXPECT_EQ(census.by_state,
            (std::map<JobState, int64_t>{
                {JobState::kUploading, 1}, {JobState::kQueued, 2}, {JobState::kRunning, 1}}));
  EXPECT_EQ(census.oldest_queue_time_ms, 10);
  EXPECT_THAT(census.running_progress, ElementsAre("{}"));
}

TEST_F(JobQueueConformance, CensusCountsTheNeedsOfQueuedJobs) {
  for (const auto& [id, needs] : std::vector<std::pair<std::string, std::string>>{
           {"a", ""}, {"b", "large"}, {"c", "large"}}) {
    JobRecord job = MakeJob(id, 1, JobState::kQueued);
    job.needs = needs;
    ASSERT_TRUE(store_->Create(job, Nothing).ok());
  }
  EXPECT_EQ(store_->Census()->queued_by_needs,
            (std::map<std::string, int64_t>{{"", 1}, {"large", 2}}));
}

}  // namespace
}  // namespace litags
