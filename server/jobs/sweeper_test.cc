#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <functional>

#include "engine/core/error_test_util.h"
#include "engine/core/temp_dir_test_util.h"
#include "server/jobs/jobs.h"
#include "server/jobs/jobs_test_util.h"
#include "server/jobs/leases.h"
#include "server/jobs/sweeper.h"
#include "server/store/digest.h"
#include "server/testing/faulty_blob_store.h"

namespace litags {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::IsEmpty;

constexpr int64_t kHourMs = 3'600'000;

class SweeperTest : public ::testing::Test {
 protected:
  SweeperTest() { Restart({}); }

  // As a server does that starts again, by default on the same data.
  void Restart(UploadLimits limits, const std::string& database = "jobs.db") {
    sweeper_.reset();
    jobs_.reset();
    store_ = *OpenSqliteJobStore(dir_.path() + "/" + database);
    jobs_ = std::make_unique<Jobs>(store_.get(), blobs_.get(), data_, clock_, limits);
    sweeper_ =
        std::make_unique<Sweeper>(store_.get(), blobs_.get(), &jobs_->uploads(), data_, clock_);
  }

  absl::Status Add(const std::string& id, const std::string& name, const std::string& bytes) {
    return AddFile(*jobs_, data_, id, name, bytes);
  }

  // A job that failed with three files, whose first had replaced the bytes "a.jpg". Its lease.
  Lease FailedJob(Leases& leases) {
    const std::string id = UploadedJob(*jobs_, data_);
    EXPECT_TRUE(Add(id, "a.jpg", "other").ok());
    EXPECT_TRUE(jobs_->Start(id).ok());
    const Lease lease = **leases.Acquire("w");
    EXPECT_TRUE(leases.Fail(lease, absl::InternalError("x")).ok());
    return lease;
  }

  bool HasBlob(const std::string& id, const std::string& bytes) {
    return blobs_->Get(BlobKey(id, Sha256::Hex(bytes))).ok();
  }

  int64_t now_ms_ = 1'000'000'000;
  Clock clock_ = [this] { return now_ms_; };
  TempDir dir_;
  DataDir data_ = *DataDir::Open(dir_.path());
  std::unique_ptr<JobStore> store_;
  std::unique_ptr<BlobStore> blobs_ = *OpenDiskBlobStore(data_.blobs());
  std::unique_ptr<Jobs> jobs_;
  std::unique_ptr<Sweeper> sweeper_;
};

TEST_F(SweeperTest, JobsThatTheStoreDoesNotKnowKeepTheirFilesForADayFromNowHoweverOldTheyAre) {
  const std::string id = jobs_->Create({})->id;
  ASSERT_TRUE(Add(id, "a.jpg", "a").ok());
  const auto days_ago = fs::file_time_type::clock::now() - std::chrono::hours(48);
  fs::last_write_time(data_.blobs() + "/jobs/" + id, days_ago);
  const auto sweep_after = [&](int hours) {
    now_ms_ += hours * kHourMs;
    ASSERT_TRUE(sweeper_->Sweep().ok());
  };

  Restart({}, "empty.db");
  sweep_after(0);
  sweep_after(20);
  EXPECT_TRUE(HasBlob(id, "a"));
  Restart({});  // the right one again
  sweep_after(1);
  EXPECT_TRUE(jobs_->Get(id).ok());
  Restart({}, "empty.db");
  sweep_after(0);
  sweep_after(23);
  EXPECT_TRUE(HasBlob(id, "a"));
  sweep_after(1);
  EXPECT_FALSE(HasBlob(id, "a"));
}

// Counts how often the marker is looked for, which may fail.
class MarkerIsLookedFor : public FaultyBlobStore {
 public:
  using FaultyBlobStore::FaultyBlobStore;
  int looks = 0;
  absl::Status fault;
  absl::StatusOr<std::vector<std::string>> List(std::string_view prefix) override {
    if (prefix != "installation") return FaultyBlobStore::List(prefix);
    ++looks;
    if (!fault.ok()) return fault;
    return FaultyBlobStore::List(prefix);
  }
};

TEST_F(SweeperTest, OrphansAreKeptADayFromWhenTheMarkerIsOursAndItIsLookedForHourly) {
  const std::string lost = "0123456789abcdef";
  ASSERT_TRUE(blobs_->Put(BlobKey(lost, Sha256::Hex("a")), "a").ok());
  const auto days_ago = fs::file_time_type::clock::now() - std::chrono::hours(48);
  fs::last_write_time(data_.blobs() + "/jobs/" + lost, days_ago);
  MarkerIsLookedFor blobs(blobs_.get());
  const InstallationMarker marker(*store_->InstallationId(), "file:///blobs", &blobs);
  Sweeper sweeper(store_.get(), &blobs, &jobs_->uploads(), data_, clock_, &marker);
  const auto sweep_for = [&](int minutes) {
    for (int end = minutes; end > 0; --end) {
      ASSERT_TRUE(sweeper.Sweep().ok());
      now_ms_ += kHourMs / 60;
    }
  };
  sweep_for(25 * 60);
  EXPECT_EQ(blobs.looks, 25);
  EXPECT_TRUE(HasBlob(lost, "a"));
  ASSERT_TRUE(marker.Claim().ok());
  sweep_for(20 * 60);
  blobs.fault = absl::UnavailableError("away");
  sweep_for(10 * 60);
  EXPECT_TRUE(HasBlob(lost, "a"));
  blobs.fault = absl::OkStatus();
  sweep_for(24 * 60);
  EXPECT_TRUE(HasBlob(lost, "a"));
  sweep_for(60);
  EXPECT_FALSE(HasBlob(lost, "a"));
}

TEST_F(SweeperTest, OrphansGoAlsoWhereTheServerIsRestartedEachNight) {
  const std::string lost = "0123456789abcdef";
  ASSERT_TRUE(blobs_->Put(BlobKey(lost, Sha256::Hex("a")), "a").ok());
  const auto days_ago = fs::file_time_type::clock::now() - std::chrono::hours(48);
  fs::last_write_time(data_.blobs() + "/jobs/" + lost, days_ago);
  const auto run_for = [&](int hours) {
    Restart({});
    for (int i = 0; i <= hours; ++i) {
      ASSERT_TRUE(sweeper_->Sweep().ok());
      now_ms_ += kHourMs;
    }
  };
  run_for(20);
  now_ms_ += 100 * kHourMs;  // no server runs
  run_for(3);
  EXPECT_TRUE(HasBlob(lost, "a"));
  run_for(1);
  EXPECT_FALSE(HasBlob(lost, "a"));
  run_for(1);
  EXPECT_FALSE(fs::exists(data_.missed()));
}

class FoldersAreNotRemoved : public FaultyBlobStore {
 public:
  using FaultyBlobStore::FaultyBlobStore;
  absl::Status RemoveFolder(std::string_view) override { return absl::UnavailableError("away"); }
};

TEST_F(SweeperTest, AJobIsDeletedAlsoWhileTheBlobStoreIsAway) {
  FoldersAreNotRemoved away(blobs_.get());
  Jobs jobs(store_.get(), &away, data_, clock_);
  const std::string id = jobs_->Create({})->id;
  ASSERT_TRUE(Add(id, "a.jpg", "a").ok());
  const auto days_ago = fs::file_time_type::clock::now() - std::chrono::hours(48);
  fs::last_write_time(data_.blobs() + "/jobs/" + id, days_ago);
  const absl::Status deleted = jobs.Delete(id);
  EXPECT_TRUE(deleted.ok()) << deleted;
  EXPECT_TRUE(absl::IsNotFound(jobs.Get(id).status()));
  EXPECT_TRUE(HasBlob(id, "a"));
  ASSERT_TRUE(sweeper_->Sweep().ok());
  now_ms_ += 24 * kHourMs;
  ASSERT_TRUE(sweeper_->Sweep().ok());
  EXPECT_FALSE(HasBlob(id, "a"));
}

// A store on another machine, whose removals do what a test wants.
class RemovalsAreSlow : public FaultyBlobStore {
 public:
  using FaultyBlobStore::FaultyBlobStore;
  std::function<absl::Status()> on_remove = [] { return absl::OkStatus(); };
  absl::Status Remove(std::string_view key) override {
    const absl::Status fault = on_remove();
    return fault.ok() ? FaultyBlobStore::Remove(key) : fault;
  }
};

TEST_F(SweeperTest, UploadedBlobsAreRemovedOutsideOfTransactionsAndNoFileLosesItsBytes) {
  RemovalsAreSlow blobs(blobs_.get());
  Jobs jobs(store_.get(), &blobs, data_, clock_);
  Sweeper sweeper(store_.get(), &blobs, &jobs.uploads(), data_, clock_);
  Leases leases(store_.get(), &blobs, {}, clock_);
  const std::string id = FailedJob(leases).job.id;

  int removals = 0;
  blobs.on_remove = [&] {
    ++removals;
    // Another connection writes meanwhile, and the file does not come back.
    const auto other = *OpenSqliteJobStore(dir_.path() + "/jobs.db");
    Jobs there(other.get(), blobs_.get(), data_, clock_);
    Sweeper theirs(other.get(), blobs_.get(), &there.uploads(), data_, clock_);
    EXPECT_TRUE(there.Create({}).ok());
    EXPECT_EQ(Reason(Add(id, "d.jpg", "a.jpg")), "JOB_BUSY");
    EXPECT_EQ(store_->ReachableSinceMs(), 0) << "the store refused nothing";
    EXPECT_EQ(there.Get(id)->state, JobState::kFailed);
    EXPECT_TRUE(theirs.Sweep().ok()) << "leaves the job alone";
    EXPECT_TRUE(HasBlob(id, "a.jpg"));
    return absl::OkStatus();
  };
  ASSERT_TRUE(sweeper.Sweep().ok());
  EXPECT_EQ(removals, 1);
  EXPECT_FALSE(HasBlob(id, "a.jpg"));
  EXPECT_EQ(jobs.Get(id)->lease_owner, "");
  ASSERT_TRUE(Add(id, "d.jpg", "a.jpg").ok());
  ASSERT_TRUE(sweeper.Sweep().ok());
  EXPECT_TRUE(HasBlob(id, "a.jpg"));
  EXPECT_TRUE(HasBlob(id, "other"));
}

TEST_F(SweeperTest, BlobsThatComeWhileASweepRemovesOthersAreRemovedByTheNext) {
  RemovalsAreSlow blobs(blobs_.get());
  Jobs jobs(store_.get(), &blobs, data_, clock_);
  Sweeper sweeper(store_.get(), &blobs, &jobs.uploads(), data_, clock_);
  Leases leases(store_.get(), &blobs, {}, clock_);
  const Lease lease = FailedJob(leases);
  const std::string& id = lease.job.id;

  // A worker that finds out only now that it has no lease any more.
  const std::string late = BlobKey(id, LeaseBlob(lease.job.last_event, Sha256::Hex("scene")));
  blobs.on_remove = [&] {
    EXPECT_TRUE(blobs_->Put(late, "scene").ok());
    return leases.NoteUnreferencedBlobs(lease);
  };
  ASSERT_TRUE(sweeper.Sweep().ok());
  EXPECT_FALSE(HasBlob(id, "a.jpg"));
  ASSERT_TRUE(sweeper.Sweep().ok());
  EXPECT_FALSE(blobs_->Get(late).ok());
  EXPECT_TRUE(store_->JobsWithUnreferencedBlobs(10)->empty());
}

TEST_F(SweeperTest, AFaultOfOneJobKeepsNothingElseAndTheFailedSweepIsRepeated) {
  RemovalsAreSlow blobs(blobs_.get());
  Jobs jobs(store_.get(), &blobs, data_, clock_);
  Sweeper sweeper(store_.get(), &blobs, &jobs.uploads(), data_, clock_);
  std::vector<std::string> ids;
  for (const char* bytes : {"1", "2"}) {
    ids.push_back(jobs_->Create({})->id);
    ASSERT_TRUE(Add(ids.back(), "a.jpg", bytes).ok());
    ASSERT_TRUE(*jobs_->uploads().Remove(ids.back(), FileRole::kPhoto, "a.jpg"));
    ASSERT_TRUE(jobs_->Cancel(ids.back()).ok());
  }
  int removals = 0;
  blobs.on_remove = [&] {
    return ++removals == 1 ? absl::InternalError("broken") : absl::OkStatus();
  };
  EXPECT_EQ(sweeper.Sweep().status().message(), "broken");
  EXPECT_EQ(removals, 2);
  EXPECT_EQ(store_->JobsWithUnreferencedBlobs(10)->size(), 1u);
  ASSERT_TRUE(sweeper.Sweep().ok());
  EXPECT_TRUE(store_->JobsWithUnreferencedBlobs(10)->empty());
  EXPECT_FALSE(HasBlob(ids[0], "1") || HasBlob(ids[1], "2"));
}

TEST_F(SweeperTest, ASweepThatIsToldToStopRemovesNoMore) {
  const std::string id = jobs_->Create({})->id;
  now_ms_ += 25 * kHourMs;
  CancelToken stop;
  stop.Cancel();
  EXPECT_TRUE(sweeper_->Sweep(stop)->empty());
  EXPECT_TRUE(jobs_->Get(id).ok());
  EXPECT_THAT(*sweeper_->Sweep(), ElementsAre(id));
}

// Such a store may take half a minute to say so, each time.
TEST_F(SweeperTest, ASweepAsksABlobStoreThatIsAwayOnceAndNotAfterItIsToldToStop) {
  class Away : public FaultyBlobStore {
   public:
    using FaultyBlobStore::FaultyBlobStore;
    absl::StatusOr<std::vector<std::string>> List(std::string_view) override {
      ++calls;
      if (on_call) on_call();
      return error;
    }
    void RemoveTemporary() override { ++calls; }
    std::function<void()> on_call;
    absl::Status error = absl::UnavailableError("away");
    int calls = 0;
  };
  Away blobs(blobs_.get());
  UploadLimits limits;
  limits.chunk_bytes = 100;
  Jobs jobs(store_.get(), &blobs, data_, clock_, limits);
  Sweeper sweeper(store_.get(), &blobs, &jobs.uploads(), data_, clock_);
  EXPECT_EQ(sweeper.Sweep().status().message(), "away");
  EXPECT_EQ(blobs.calls, 1);
  CancelToken stop;
  blobs.on_call = [&] { stop.Cancel(); };
  blobs.error = absl::InternalError("broken");
  EXPECT_EQ(sweeper.Sweep(stop).status().message(), "broken");
  EXPECT_EQ(blobs.calls, 2);
}

TEST_F(SweeperTest, NoUploadExpiresForTheTimeInWhichTheServiceWasAway) {
  const std::string id = jobs_->Create({})->id;
  now_ms_ += 100 * kHourMs;
  Restart({});
  EXPECT_THAT(*sweeper_->Sweep(), IsEmpty());
  EXPECT_EQ(jobs_->Get(id)->expire_time_ms, now_ms_ + 12 * kHourMs);
  now_ms_ += 11 * kHourMs;
  EXPECT_THAT(*sweeper_->Sweep(), IsEmpty());
  now_ms_ += kHourMs;
  EXPECT_THAT(*sweeper_->Sweep(), ElementsAre(id));
}

TEST_F(SweeperTest, TimeInWhichTheMachineSleepsIsNoTimeWithAServer) {
  int64_t awake_ms = 0;
  Sweeper sweeper(store_.get(), blobs_.get(), &jobs_->uploads(), data_, clock_, nullptr,
                  [&] { return awake_ms; });
  const std::string lost = "0123456789abcdef";
  ASSERT_TRUE(blobs_->Put(BlobKey(lost, Sha256::Hex("a")), "a").ok());
  const auto days_ago = fs::file_time_type::clock::now() - std::chrono::hours(48);
  fs::last_write_time(data_.blobs() + "/jobs/" + lost, days_ago);
  const auto pass = [&](int hours, bool awake) {
    now_ms_ += hours * kHourMs;
    if (awake) awake_ms += hours * kHourMs;
    return *sweeper.Sweep();
  };
  EXPECT_THAT(pass(0, true), IsEmpty());
  EXPECT_THAT(pass(20, true), IsEmpty());
  const std::string id = jobs_->Create({})->id;
  EXPECT_THAT(pass(100, false), IsEmpty());
  EXPECT_THAT(pass(3, true), IsEmpty());
  EXPECT_TRUE(HasBlob(lost, "a"));
  EXPECT_THAT(pass(8, true), IsEmpty());
  EXPECT_FALSE(HasBlob(lost, "a"));
  EXPECT_THAT(pass(1, true), ElementsAre(id));
}

TEST_F(SweeperTest, EndedJobsWhoseTimeHasComeOnlyByAClockSetForwardAreKeptHalfADay) {
  int64_t awake_ms = 0;
  Sweeper sweeper(store_.get(), blobs_.get(), &jobs_->uploads(), data_, clock_, nullptr,
                  [&] { return awake_ms; });
  const auto ended = [&](int keep_hours) {
    NewJob wanted;
    wanted.policy.retention_seconds = keep_hours * 3600;
    const std::string id = jobs_->Create(wanted)->id;
    EXPECT_TRUE(jobs_->Cancel(id).ok());
    return id;
  };
  const auto set_clock = [&](int by_hours) { now_ms_ += by_hours * kHourMs; };
  const auto pass = [&](int hours) {
    now_ms_ += hours * kHourMs;
    awake_ms += hours * kHourMs;
    return *sweeper.Sweep();
  };
  const std::string first = ended(7 * 24), next = ended(7 * 24 + 1), soon = ended(2);
  const int64_t expire_ms = jobs_->Get(first)->expire_time_ms;
  EXPECT_THAT(pass(1), IsEmpty());
  set_clock(30 * 24);
  EXPECT_THAT(pass(0), IsEmpty());
  set_clock(-30 * 24);
  EXPECT_THAT(pass(0), IsEmpty());
  EXPECT_EQ(jobs_->Get(first)->expire_time_ms, expire_ms);

  set_clock(7 * 24 - 2);  // an hour before the first is due
  EXPECT_THAT(pass(0), IsEmpty());
  EXPECT_THAT(pass(1), ElementsAre(soon)) << "its time has come without the jump, too";
  const std::string after = ended(2);
  EXPECT_THAT(pass(1), IsEmpty());
  EXPECT_THAT(pass(1), ElementsAre(after)) << "it ended after the jump";
  EXPECT_THAT(pass(8), IsEmpty());
  EXPECT_THAT(pass(1), ElementsAre(first, next)) << "the clock was right, as after a sleep";
}

TEST_F(SweeperTest, AJobWhoseEndIsStillToBeToldExpiresAfterThatOrADay) {
  const auto ended = [&] {
    NewJob wanted;
    wanted.policy.retention_seconds = 60;
    const std::string id = jobs_->Create(wanted)->id;
    EXPECT_TRUE(jobs_->Cancel(id).ok());
    return id;
  };
  const auto set_due = [&](const std::string& id, int64_t due_ms) {
    EXPECT_TRUE(store_
                    ->Update(id,
                             [&](JobTransaction& job) {
                               job.job.webhook_due_ms = due_ms;
                               return absl::OkStatus();
                             })
                    .ok());
  };
  const std::string told = ended(), never = ended();
  for (const std::string& id : {told, never}) set_due(id, now_ms_ + kHourMs);
  now_ms_ += 120'000;
  EXPECT_TRUE(sweeper_->Sweep()->empty());
  set_due(told, 0);
  now_ms_ += 2 * kHourMs;
  EXPECT_THAT(*sweeper_->Sweep(), ElementsAre(told));
  now_ms_ += 24 * kHourMs;  // no server tells anybody
  EXPECT_THAT(*sweeper_->Sweep(), ElementsAre(never));
}

}  // namespace
}  // namespace litags
