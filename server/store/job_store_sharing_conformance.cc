// What every job store must do when several threads and processes use it, or one is killed.
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <mutex>
#include <thread>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "server/store/job_store.h"
#include "server/testing/job_store_kind.h"

namespace litags {
namespace {

class JobStoreSharing : public StoreConformance {};

TEST_F(JobStoreSharing, EventsAreNumberedWithoutGapsWhenSeveralConnectionsWrite) {
  ASSERT_TRUE(store_->Create(MakeJob("a1", 1), Nothing).ok());
  constexpr int kWriters = 3, kEach = 15;
  std::vector<std::thread> writers;
  for (int w = 0; w < kWriters; ++w) {
    writers.emplace_back([this, w] {
      auto store = Open();  // its own connection, as in another process
      for (int i = 0; i < kEach; ++i) {
        const auto status = store->Update("a1", [&](JobTransaction& job) {
          return job.AddEvent({0, 1, EventKind::kProgress, std::to_string(w)});
        });
        EXPECT_TRUE(status.ok()) << status.status();
      }
    });
  }
  for (auto& t : writers) t.join();
  const auto events = store_->Events("a1", 0, 1000);
  ASSERT_EQ(events->size(), size_t{kWriters * kEach});
  for (size_t i = 0; i < events->size(); ++i) {
    EXPECT_EQ((*events)[i].number, static_cast<int64_t>(i + 1));
  }
  EXPECT_EQ(store_->Get("a1")->last_event, kWriters * kEach);
  const auto page = store_->Events("a1", 10, 2);
  ASSERT_EQ(page->size(), 2u);
  EXPECT_EQ((*page)[0].number, 11);
}

TEST_F(JobStoreSharing, WaitingEndsWithOwnAndForeignChangesAndElseWithItsTime) {
  auto other = Open();
  // A store may see a change of before; then all is quiet.
  int64_t token = *store_->WaitForChange(ChangeTopic::kJobs, -1, 0);
  const auto becomes_quiet = [&] {
    for (int i = 0; i < 10; ++i) {
      const int64_t before = token;
      token = *store_->WaitForChange(ChangeTopic::kJobs, before, 1.5);
      if (token == before) return true;
    }
    return false;
  };
  ASSERT_TRUE(becomes_quiet());
  for (JobStore* writer : {store_.get(), other.get()}) {
    std::thread change([writer] {
      std::this_thread::sleep_for(std::chrono::milliseconds(50));
      EXPECT_TRUE(writer->Create(MakeJob("a", 1), Nothing).ok());
      EXPECT_TRUE(writer->Update("a", [](JobTransaction& job) { return job.Remove(); }).ok());
    });
    const int64_t after = *store_->WaitForChange(ChangeTopic::kJobs, token, 20);
    EXPECT_NE(after, token);
    change.join();
    ASSERT_TRUE(becomes_quiet());
  }
}

TEST_F(JobStoreSharing, WhoWaitsForTheQueueLearnsOfAQueuedJob) {
  int64_t token = *store_->WaitForChange(ChangeTopic::kQueue, -1, 0);
  auto other = Open();
  ASSERT_TRUE(other->Create(MakeJob("a1", 1), Nothing).ok());
  const auto queue = [](JobTransaction& job) {
    job.job.state = JobState::kQueued;
    return absl::OkStatus();
  };
  ASSERT_TRUE(other->Update("a1", queue).ok());
  const auto found = [&] { return store_->UpdateFirstQueued(FitsAny, Nothing)->has_value(); };
  for (int i = 0; i < 20 && !found(); ++i) {
    token = *store_->WaitForChange(ChangeTopic::kQueue, token, 20);
  }
  EXPECT_TRUE(found());
}

TEST_F(JobStoreSharing, EveryQueuedJobGoesToOneOfManyTakers) {
  constexpr int kJobs = 24, kTakers = 4;
  for (int i = 0; i < kJobs; ++i) {
    ASSERT_TRUE(
        store_->Create(MakeJob(absl::StrCat("job", i), i, JobState::kQueued), Nothing).ok());
  }
  std::mutex mutex;
  std::vector<std::string> taken;
  std::vector<std::thread> takers;
  for (int t = 0; t < kTakers; ++t) {
    takers.emplace_back([&] {
      auto store = Open();
      for (;;) {
        const auto job = store->UpdateFirstQueued(FitsAny, [](JobTransaction& job) {
          job.job.state = JobState::kRunning;
          ++job.job.attempt;
          return absl::OkStatus();
        });
        ASSERT_TRUE(job.ok()) << job.status();
        if (!job->has_value()) return;
        std::lock_guard lock(mutex);
        taken.push_back((*job)->id);
      }
    });
  }
  for (auto& t : takers) t.join();
  // A taker may find nothing while another holds the last jobs, but none is left over or taken
  // twice.
  EXPECT_EQ(taken.size(), size_t{kJobs});
  const auto jobs = store_->List(0, "", 100);
  ASSERT_EQ(jobs->size(), size_t{kJobs});
  for (const JobRecord& job : *jobs) EXPECT_EQ(job.attempt, 1) << job.id;
}

TEST_F(JobStoreSharing, ChangesOfOneJobAtTheSameTimeAreAllKept) {
  ASSERT_TRUE(store_->Create(MakeJob("a1", 1), Nothing).ok());
  constexpr int kThreads = 4, kEach = 10;
  std::vector<std::thread> threads;
  for (int t = 0; t < kThreads; ++t) {
    threads.emplace_back([&] {
      for (int i = 0; i < kEach; ++i) {
        const auto status = store_->Update("a1", [](JobTransaction& job) {
          ++job.job.run_ms;
          return absl::OkStatus();
        });
        EXPECT_TRUE(status.ok()) << status.status();
      }
    });
  }
  for (auto& t : threads) t.join();
  EXPECT_EQ(store_->Get("a1")->run_ms, kThreads * kEach);
}

TEST_F(JobStoreSharing, RequestsOfTheSameIdAtTheSameTimeMakeOneJob) {
  constexpr int kThreads = 4;
  std::vector<std::string> ids(kThreads);
  std::vector<std::thread> threads;
  for (int t = 0; t < kThreads; ++t) {
    threads.emplace_back([&, t] {
      JobRecord job = MakeJob(absl::StrCat("a", t), 1);
      job.request_id = "same";
      const auto made = store_->Create(job, [](JobTransaction& transaction) {
        return transaction.AddEvent({0, 1, EventKind::kState, "made"});
      });
      ASSERT_TRUE(made.ok()) << made.status();
      ids[t] = made->id;
    });
  }
  for (auto& t : threads) t.join();
  for (const std::string& id : ids) EXPECT_EQ(id, ids[0]);
  EXPECT_EQ(store_->List(0, "", 10)->size(), 1u);
  EXPECT_EQ(store_->Events(ids[0], 0, 10)->size(), 1u);
}

TEST_F(JobStoreSharing, QuotaIsNotOverrunByJobsMadeAtTheSameTime) {
  constexpr int kThreads = 6, kQuota = 3;
  std::vector<std::thread> threads;
  for (int t = 0; t < kThreads; ++t) {
    threads.emplace_back([&, t] {
      JobRecord job = MakeJob(absl::StrCat("a", t), 1);
      job.owner = "alice";
      const auto made = store_->Create(job, [](JobTransaction& transaction) -> absl::Status {
        LITAGS_ASSIGN_OR_RETURN(const OwnerUsage usage, transaction.Usage());
        return usage.jobs <= kQuota ? absl::OkStatus() : absl::ResourceExhaustedError("quota");
      });
      EXPECT_TRUE(made.ok() || absl::IsResourceExhausted(made.status())) << made.status();
    });
  }
  for (auto& t : threads) t.join();
  EXPECT_EQ(store_->List(0, "", 10, "alice")->size(), size_t{kQuota});
}

TEST_F(JobStoreSharing, EmptyPlaceIsLaidOutOnceByManyAtTheSameTime) {
  const auto kind = MakeTestedKind();
  std::vector<std::string> ids(4);
  std::vector<std::thread> openers;
  for (std::string& id : ids) {
    openers.emplace_back([&] {
      const auto store = kind->Open();
      ASSERT_TRUE(store.ok()) << store.status();
      id = *(*store)->InstallationId();
    });
  }
  for (auto& t : openers) t.join();
  const auto store = *kind->Open();
  EXPECT_TRUE(store->Create(MakeJob("a1", 1), Nothing).ok());
  for (const std::string& id : ids) EXPECT_EQ(id, *store->InstallationId());
}

TEST_F(JobStoreSharing, AcknowledgedJobSurvivesKillOfItsProcess) {
  int pipe_fds[2];
  ASSERT_EQ(pipe(pipe_fds), 0);
  const pid_t child = fork();
  if (child == 0) {
    auto store = kind_->Open();
    if (store.ok() && (*store)->Create(MakeJob("a1", 1), Nothing).ok()) {
      if (write(pipe_fds[1], "k", 1) == 1) pause();
    }
    _exit(1);
  }
  close(pipe_fds[1]);  // a child that fails ends the read
  char ack = 0;
  ASSERT_EQ(read(pipe_fds[0], &ack, 1), 1);
  kill(child, SIGKILL);
  waitpid(child, nullptr, 0);
  close(pipe_fds[0]);
  auto store = kind_->Open();
  ASSERT_TRUE(store.ok());
  EXPECT_TRUE((*store)->Get("a1").ok());
}

}  // namespace
}  // namespace litags
