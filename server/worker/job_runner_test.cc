// Jobs that a worker takes and cannot begin.
#include "server/worker/job_runner.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <spdlog/sinks/ostream_sink.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <filesystem>
#include <functional>
#include <optional>
#include <sstream>
#include <thread>

#include "engine/core/error_test_util.h"
#include "engine/core/temp_dir_test_util.h"
#include "server/jobs/codec.h"
#include "server/jobs/jobs.h"
#include "server/jobs/jobs_test_util.h"
#include "server/testing/eventually.h"
#include "server/testing/fake_engine.h"
#include "server/testing/faulty_blob_store.h"
#include "server/testing/forwarding_job_store.h"
#include "server/testing/no_room.h"
#include "server/worker/self_check.h"
#include "server/worker/worker.h"

namespace litags {
namespace {

absl::Status Denied(std::string_view) {
  return MakeError(absl::StatusCode::kFailedPrecondition, "BLOBS_DENIED", "blobs", "expired");
}
absl::Status NoFault(std::string_view) { return absl::OkStatus(); }

class JobRunnerTest : public ::testing::Test {
 protected:
  JobRunnerTest() {
    options_.name = "w1";
    EXPECT_TRUE(marker_.Claim().ok());
    spdlog::default_logger()->sinks().push_back(log_sink_);
  }
  ~JobRunnerTest() override {
    spdlog::default_logger()->sinks().pop_back();
    EXPECT_EQ(log_.str().find("error-detail"), std::string::npos) << log_.str();
  }

  std::string QueuedJob(const char* first_photo = "a.jpg", const JobPolicy& policy = {}) {
    NewJob wanted;
    wanted.policy = policy;
    wanted.options.iterations = 3;
    const std::string id = jobs_.Create(wanted)->id;
    for (const char* name : {first_photo, "b.jpg", "c.jpg"}) {
      EXPECT_TRUE(AddFile(jobs_, data_, id, name, name).ok());
    }
    EXPECT_TRUE(jobs_.Start(id).ok());
    return id;
  }

  absl::Status Run() { return RunJob(**leases_.Acquire("w1"), context_, options_, CancelToken()); }

  void ExpectGivenBack(const std::string& id, const std::string& why) {
    const JobRecord job = *jobs_.Get(id);
    EXPECT_EQ(job.state, JobState::kQueued);
    EXPECT_EQ(job.attempt, 0);
    EXPECT_EQ(store_->Log(id, 0, 99)->back().text,
              "QUEUED: worker w1 cannot begin jobs now: " + why +
                  "; the job waits for a worker that can");
  }

  TempDir dir_;
  DataDir data_ = *DataDir::Open(dir_.path());
  std::unique_ptr<JobStore> store_ = *OpenSqliteJobStore(data_.database());
  std::unique_ptr<BlobStore> disk_ = *OpenDiskBlobStore(data_.blobs());
  FaultyBlobStore blobs_{disk_.get()};
  Jobs jobs_{store_.get(), disk_.get(), data_};
  Leases leases_{store_.get(), &blobs_};
  std::unique_ptr<Engine> engine_ = MakeFakeEngine();
  const InstallationMarker marker_{*store_->InstallationId(), data_.blobs(), disk_.get()};
  WorkerContext context_{store_.get(), &blobs_, &leases_, engine_.get(), data_, &marker_};
  WorkerOptions options_;
  std::ostringstream log_;
  const spdlog::sink_ptr log_sink_ = std::make_shared<spdlog::sinks::ostream_sink_mt>(log_);
};

TEST_F(JobRunnerTest, WorkerThatTheBlobStoreRefusesGivesTheJobBack) {
  const std::string id = QueuedJob();
  blobs_.on_read = Denied;
  EXPECT_EQ(Reason(Run()), "BLOBS_DENIED");
  ExpectGivenBack(id, "the blob store refuses its key");
  EXPECT_THAT(log_.str(), testing::HasSubstr("given back: expired (BLOBS_DENIED)"));
  blobs_.on_read = NoFault;
  EXPECT_TRUE(Run().ok());
  EXPECT_EQ(jobs_.Get(id)->state, JobState::kSucceeded);
}

TEST_F(JobRunnerTest, WorkerWithoutScratchGivesTheJobBack) {
  const std::string id = QueuedJob();
  std::filesystem::remove_all(data_.scratch());
  EXPECT_EQ(Reason(Run()), "STORE_FAILED");
  ExpectGivenBack(id, "it cannot read or write its files");
}

// Started without the server's --blobs, say, or before the volume was mounted.
TEST_F(JobRunnerTest, WorkerThatSeesOtherBlobsThanTheServerGivesTheJobBack) {
  const std::string id = QueuedJob();
  const auto elsewhere = *OpenDiskBlobStore(dir_.path() + "/elsewhere");
  const InstallationMarker marker(*store_->InstallationId(), "file:///blobs", elsewhere.get());
  context_.blobs = elsewhere.get();
  context_.marker = &marker;
  EXPECT_EQ(Reason(Run()), "BLOB_NOT_FOUND");
  ExpectGivenBack(id, "it does not see the server's files");
  ASSERT_TRUE(elsewhere->Put("jobs/0123456789abcdef/aa", "of another job").ok());
  EXPECT_EQ(Reason(Run()), "BLOB_NOT_FOUND");
  ExpectGivenBack(id, "it does not see the server's files");
  ASSERT_TRUE(marker.Claim().ok());
  EXPECT_TRUE(Run().ok());
  EXPECT_EQ(jobs_.Get(id)->state, JobState::kFailed) << "where the files should be, they are not";
}

TEST_F(JobRunnerTest, JobWhosePhotoCannotBeReadFailsAndNotItsWorker) {
  const std::string id = QueuedJob();
  blobs_.on_read = [](std::string_view key) {
    return key == "self-check" ? absl::OkStatus()
                               : MakeError(absl::StatusCode::kInternal, "STORE_FAILED", "", "EIO");
  };
  EXPECT_TRUE(Run().ok());
  EXPECT_EQ(jobs_.Get(id)->state, JobState::kFailed);
  EXPECT_EQ(Decode<JobError>(jobs_.Get(id)->error)->detail.reason, "STORE_FAILED");
}

TEST_F(JobRunnerTest, JobThatDoesNotFitOnTheDiskFailsAndNotItsWorker) {
  const std::string id = QueuedJob();
  const absl::Status full =
      MakeError(absl::StatusCode::kResourceExhausted, "DISK_FULL", "", "no room");
  int photos = 0;
  blobs_.on_read = [&](std::string_view key) {
    if (key != "self-check") return ++photos < 3 ? absl::OkStatus() : full;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(data_.scratch())) {
      if (entry.path().extension() == ".jpg") return full;
    }
    return absl::OkStatus();
  };
  EXPECT_TRUE(Run().ok());
  ASSERT_EQ(jobs_.Get(id)->state, JobState::kFailed);
  EXPECT_EQ(Decode<JobError>(jobs_.Get(id)->error)->detail.reason, "DISK_FULL");
}

TEST_F(JobRunnerTest, TimeInWhichABlobStoreIsAwayIsNoRunTime) {
  JobPolicy policy;
  policy.max_run_seconds = 0.3;
  options_.poll_seconds = 0.01;
  // For longer than the job may run, from the first call on.
  const auto away_at_first = [] {
    return [first = std::optional<std::chrono::steady_clock::time_point>()](
               std::string_view) mutable -> absl::Status {
      const auto now = std::chrono::steady_clock::now();
      if (!first) first = now;
      return now < *first + std::chrono::seconds(1) ? absl::UnavailableError("away")
                                                    : absl::OkStatus();
    };
  };
  const std::string before = QueuedJob("a.jpg", policy);
  blobs_.on_read = away_at_first();
  EXPECT_TRUE(Run().ok());
  EXPECT_EQ(jobs_.Get(before)->state, JobState::kSucceeded) << jobs_.Get(before)->error;
  const std::string after = QueuedJob("a.jpg", policy);
  blobs_.on_write = away_at_first();
  EXPECT_TRUE(Run().ok());
  EXPECT_EQ(jobs_.Get(after)->state, JobState::kSucceeded) << jobs_.Get(after)->error;
}

TEST_F(JobRunnerTest, TimeInWhichABlobStoreIsAwayIsNoRunTimeOfTheNextLeaseEither) {
  JobPolicy policy;
  policy.max_run_seconds = 0.3;
  options_.poll_seconds = 0.01;
  const std::string id = QueuedJob("a.jpg", policy);
  CancelToken shutdown;
  const auto start = std::chrono::steady_clock::now();
  blobs_.on_read = [&](std::string_view) {
    if (std::chrono::steady_clock::now() > start + std::chrono::seconds(1)) shutdown.Cancel();
    return absl::UnavailableError("away");
  };
  EXPECT_TRUE(RunJob(**leases_.Acquire("w1"), context_, options_, shutdown).ok());
  EXPECT_EQ(jobs_.Get(id)->state, JobState::kQueued);
  EXPECT_EQ(jobs_.Get(id)->run_ms, 0);
  blobs_.on_read = NoFault;
  EXPECT_TRUE(Run().ok());
  EXPECT_EQ(jobs_.Get(id)->state, JobState::kSucceeded) << jobs_.Get(id)->error;
}

TEST_F(JobRunnerTest, CancelEndsTheFetchingOfFilesAfterTheFileAndNotTheWorker) {
  const std::string id = QueuedJob();
  std::atomic<bool> gave_up = false;
  options_.give_up = [&] { gave_up = true; };
  options_.grace_seconds = 0.1;
  options_.poll_seconds = 0.01;
  int reads = 0;
  blobs_.on_read = [&](std::string_view) {
    if (++reads == 1) {
      EXPECT_TRUE(jobs_.Cancel(id).ok());
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(400));
    return absl::OkStatus();
  };
  EXPECT_TRUE(Run().ok());
  EXPECT_FALSE(gave_up);
  EXPECT_LT(reads, 3);
  EXPECT_EQ(jobs_.Get(id)->state, JobState::kCancelled);
}

TEST_F(JobRunnerTest, ShutdownEndsTheFetchingOfACancelledJobsFile) {
  const std::string id = QueuedJob();
  std::atomic<bool> gave_up = false;
  options_.give_up = [&] { gave_up = true; };
  options_.grace_seconds = 0.1;
  options_.poll_seconds = 0.01;
  CancelToken shutdown;
  int reads = 0;
  blobs_.on_read = [&](std::string_view) {
    if (++reads > 1) return absl::OkStatus();
    EXPECT_TRUE(jobs_.Cancel(id).ok());
    std::this_thread::sleep_for(std::chrono::milliseconds(400));
    EXPECT_FALSE(gave_up);
    shutdown.Cancel();
    EXPECT_TRUE(Eventually([&] { return gave_up.load(); }));
    return absl::OkStatus();
  };
  // The end is written already; a real worker would not come to write it again.
  RunJob(**leases_.Acquire("w1"), context_, options_, shutdown).IgnoreError();
  EXPECT_EQ(jobs_.Get(id)->state, JobState::kCancelled);
}

// An engine that says two things, the second of which is written after its end.
class Talkative : public Engine {
 public:
  explicit Talkative(std::function<void()> between) : between_(std::move(between)) {}
  absl::StatusOr<ReconstructReport> Reconstruct(const ReconstructInput&, const ReconstructOptions&,
                                                const CancelToken&,
                                                ReconstructObserver* observer) override {
    Progress progress;
    progress.stage = Stage::kTraining;
    for (progress.iteration = 1; progress.iteration <= 2; ++progress.iteration) {
      observer->OnProgress(progress);
      if (progress.iteration == 1) between_();
    }
    return absl::InternalError("no scene");
  }
  absl::StatusOr<std::shared_ptr<const Scene>> LoadScene(const std::string&) override {
    return absl::UnimplementedError("no scenes");
  }

 private:
  const std::function<void()> between_;
};

TEST_F(JobRunnerTest, LastProgressIsWrittenAlsoWhenTheStoreWasAwayAtTheEnd) {
  class AwayOnce : public ForwardingJobStore {
   public:
    explicit AwayOnce(JobStore* store) : ForwardingJobStore(store) {}
    absl::StatusOr<JobRecord> Update(std::string_view id, Change change) override {
      if (away.exchange(false)) return absl::UnavailableError("away");
      return ForwardingJobStore::Update(id, change);
    }
    std::atomic<bool> away = false;
  };
  AwayOnce store(store_.get());
  Leases leases(&store, &blobs_);
  const std::string id = QueuedJob();
  const auto last_iteration = [&] {
    const std::string progress = store_->Get(id)->progress;
    return progress.empty() ? 0 : Decode<ProgressRecord>(progress)->progress.iteration;
  };
  Talkative engine([&] {
    const auto is_written = [&] {
      return store_->Log(id, 0, 99)->back().text.find("iteration 1") != std::string::npos;
    };
    for (int i = 0; i < 500 && !is_written(); ++i) {
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
    store.away = true;
  });
  context_.leases = &leases;
  context_.engine = &engine;
  options_.poll_seconds = options_.progress_seconds = 60;
  EXPECT_TRUE(Run().ok());
  EXPECT_EQ(last_iteration(), 2);
}

TEST_F(JobRunnerTest, AllEntriesOfALogHaveTheTimesOfTheStoresClock) {
  class HourAhead : public ForwardingJobStore {
   public:
    explicit HourAhead(JobStore* store) : ForwardingJobStore(store) {}
    int64_t NowMs() override { return ForwardingJobStore::NowMs() + 3'600'000; }
  };
  HourAhead store(store_.get());
  Leases leases(store_.get(), &blobs_, {}, StoreClock(&store));
  context_.store = &store;
  context_.leases = &leases;
  const std::string id = QueuedJob();
  EXPECT_TRUE(RunJob(**leases.Acquire("w1"), context_, options_, CancelToken()).ok());
  ASSERT_EQ(jobs_.Get(id)->state, JobState::kSucceeded) << jobs_.Get(id)->error;
  const std::vector<LogEntry> log = *store_->Log(id, 0, 99);
  for (size_t i = 1; i < log.size(); ++i) {
    EXPECT_GE(log[i].time_ms, log[i - 1].time_ms) << log[i].text;
  }
}

TEST_F(JobRunnerTest, MemoryIsLimitedWhileTheJobStoreIsAway) {
  // Away until the engine has stopped.
  class AwayStore : public ForwardingJobStore {
   public:
    explicit AwayStore(JobStore* store) : ForwardingJobStore(store) {}
    absl::StatusOr<JobRecord> Get(std::string_view id) override {
      if (away) return absl::UnavailableError("away");
      return ForwardingJobStore::Get(id);
    }
    absl::StatusOr<JobRecord> Update(std::string_view id, Change change) override {
      if (away) return absl::UnavailableError("away");
      return ForwardingJobStore::Update(id, change);
    }
    std::atomic<bool> away = true;
  };
  class Greedy : public Engine {
   public:
    explicit Greedy(AwayStore* store) : store_(store) {}
    absl::StatusOr<ReconstructReport> Reconstruct(const ReconstructInput&,
                                                  const ReconstructOptions&,
                                                  const CancelToken& cancel,
                                                  ReconstructObserver*) override {
      for (int i = 0; i < 500 && !cancel.IsCancelled(); ++i) {
        std::this_thread::sleep_for(std::chrono::milliseconds(20));
      }
      store_->away = false;
      return absl::CancelledError("");
    }
    absl::StatusOr<std::shared_ptr<const Scene>> LoadScene(const std::string&) override {
      return absl::UnimplementedError("no scenes");
    }

   private:
    AwayStore* const store_;
  };
  AwayStore store(store_.get());
  Leases leases(&store, &blobs_);
  Greedy engine(&store);
  context_.leases = &leases;
  context_.engine = &engine;
  options_.has.memory_bytes = 8000;  // less than any process holds
  options_.poll_seconds = 0.01;
  const std::string id = QueuedJob();
  EXPECT_TRUE(Run().ok());
  ASSERT_EQ(jobs_.Get(id)->state, JobState::kFailed);
  EXPECT_EQ(Decode<JobError>(jobs_.Get(id)->error)->detail.reason, "MEMORY_EXCEEDED");
}

TEST_F(JobRunnerTest, JobWhoseSceneWasNotStoredFails) {
  const std::string id = QueuedJob();
  blobs_.on_write = [](std::string_view) {
    return MakeError(absl::StatusCode::kNotFound, "BLOB_NOT_FOUND", "", "404 to a write");
  };
  EXPECT_TRUE(Run().ok());
  EXPECT_EQ(jobs_.Get(id)->state, JobState::kFailed);
}

// Its key expired while the job ran.
TEST_F(JobRunnerTest, JobWhoseSceneIsRefusedWaitsUntilItIsTaken) {
  const std::string id = QueuedJob();
  blobs_.on_write = [&](std::string_view key) {
    const std::vector<LogEntry> log = *store_->Log(id, 0, 999);
    const bool waits = std::any_of(log.begin(), log.end(), [](const LogEntry& entry) {
      return entry.text == "waiting: the blob store refuses the worker's key";
    });
    return waits ? absl::OkStatus() : Denied(key);
  };
  EXPECT_TRUE(Run().ok());
  EXPECT_EQ(jobs_.Get(id)->state, JobState::kSucceeded) << jobs_.Get(id)->error;
}

TEST_F(JobRunnerTest, ShutdownGivesAJobBackWhoseSceneIsRefused) {
  const std::string id = QueuedJob();
  CancelToken shutdown;
  options_.poll_seconds = 0.01;
  blobs_.on_write = [&](std::string_view key) {
    shutdown.Cancel();
    return Denied(key);
  };
  EXPECT_TRUE(RunJob(**leases_.Acquire("w1"), context_, options_, shutdown).ok());
  EXPECT_EQ(jobs_.Get(id)->state, JobState::kQueued);
  blobs_.on_write = NoFault;
  EXPECT_TRUE(Run().ok());
  EXPECT_EQ(jobs_.Get(id)->state, JobState::kSucceeded);
}

TEST_F(JobRunnerTest, JobThatAsksForNoMemoryGetsSevenEighthsOfItsWorkers) {
  const std::string id = QueuedJob("hang.jpg");  // which obeys the cancel token
  options_.has.memory_bytes = 8000;              // less than any process holds
  options_.poll_seconds = 0.01;
  EXPECT_TRUE(Run().ok());
  const JobRecord job = *jobs_.Get(id);
  ASSERT_EQ(job.state, JobState::kFailed);
  const JobError error = *Decode<JobError>(job.error);
  EXPECT_EQ(error.detail.reason, "MEMORY_EXCEEDED");
  EXPECT_THAT(error.message, testing::HasSubstr("its limit is 7000"));
}

TEST_F(JobRunnerTest, WorkerWithRoomForNoSmallJobIsNotWell) {
  EXPECT_TRUE(CheckWorker(context_).ok());
  const NoRoom no_room(10 << 20);
  EXPECT_FALSE(CheckWorker(context_).ok());
}

TEST_F(JobRunnerTest, SickWorkerTakesNoJobsUntilItIsWellAgain) {
  const std::string first = QueuedJob(), second = QueuedJob();
  std::atomic<bool> denies = true;
  std::atomic<int> reads = 0;
  blobs_.on_read = [&](std::string_view key) {
    ++reads;
    return denies ? Denied(key) : absl::OkStatus();
  };
  options_.min_rest_seconds = 0.05;
  options_.max_rest_seconds = 0.2;
  CancelToken shutdown;
  std::thread worker([&] { RunWorker(context_, options_, shutdown); });
  const auto wait_for = [](const std::function<bool()>& done) {
    for (int i = 0; i < 500 && !done(); ++i) {
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
    EXPECT_TRUE(done());
  };
  wait_for([&] { return reads >= 6; });  // one of the job, the others of checks
  ExpectGivenBack(first, "the blob store refuses its key");
  EXPECT_EQ(jobs_.Get(first)->last_event, 4) << "it was taken once";
  EXPECT_EQ(jobs_.Get(second)->last_event, 2);
  denies = false;
  wait_for([&] {
    return jobs_.Get(first)->state == JobState::kSucceeded &&
           jobs_.Get(second)->state == JobState::kSucceeded;
  });
  shutdown.Cancel();
  worker.join();
}

}  // namespace
}  // namespace litags
