// Leases on every kind of store: whoever lost one can write nothing more.
#include <gtest/gtest.h>

#include <chrono>
#include <functional>
#include <thread>

#include "engine/core/error.h"
#include "engine/core/error_test_util.h"
#include "engine/core/temp_dir_test_util.h"
#include "server/jobs/codec.h"
#include "server/jobs/leases.h"
#include "server/testing/job_store_kind.h"

namespace litags {
namespace {

constexpr int64_t kLeaseMs = 300;
const KeptFiles kNew{{kSceneFile, {"2/aa", 5}}}, kLate{{kSceneFile, {"1/bb", 6}}};

// What a worker may write under a lease.
struct Write {
  const char* name;
  std::function<absl::Status(Leases&, const Lease&)> call;
};

std::vector<Write> AllWrites() {
  return {
      {"heartbeat", [](Leases& l, const Lease& lease) { return l.Heartbeat(lease, 0).status(); }},
      {"progress", [](Leases& l, const Lease& lease) { return l.AddProgress(lease, {}); }},
      {"files", [](Leases& l, const Lease& lease) { return l.Keep(lease, kLate, {}); }},
      {"snapshot", [](Leases& l, const Lease& lease) { return l.Keep(lease, kLate, 7); }},
      {"result",
       [](Leases& l, const Lease& lease) { return l.Succeed(lease, ReconstructReport(), kLate); }},
      {"failure",
       [](Leases& l, const Lease& lease) { return l.Fail(lease, absl::InternalError("late")); }},
      {"stop", [](Leases& l, const Lease& lease) { return l.Stopped(lease); }},
      {"return", [](Leases& l, const Lease& lease) { return l.GiveBack(lease, 0); }},
  };
}

class FencingConformance : public StoreConformance {
 protected:
  void SetUp() override {
    StoreConformance::SetUp();
    if (IsSkipped()) return;
    leases_ = std::make_unique<Leases>(store_.get(), blobs_.get(), LeaseOptions{kLeaseMs, 3});
    jobs_ = std::make_unique<Jobs>(store_.get(), blobs_.get(), data_);
    JobRecord job;
    job.id = "a1";
    job.state = JobState::kQueued;
    job.create_time_ms = job.queue_time_ms = store_->NowMs();
    ASSERT_TRUE(store_
                    ->Create(job,
                             [](JobTransaction& t) {
                               return t.PutFile({"a", FileRole::kPhoto, 1, "0"});
                             })
                    .ok());
    ASSERT_TRUE(store_
                    ->Update("a1",
                             [](JobTransaction& t) -> absl::Status {
                               LITAGS_RETURN_IF_ERROR(t.PutFile({"b", FileRole::kPhoto, 1, "0"}));
                               return t.PutFile({"c", FileRole::kPhoto, 1, "0"});
                             })
                    .ok());
  }

  // Tries until the job can be had.
  Lease Acquire(const std::string& owner) {
    for (int i = 0; i < 200; ++i) {
      auto lease = leases_->Acquire(owner);
      EXPECT_TRUE(lease.ok()) << lease.status();
      if (lease.ok() && lease->has_value()) return **lease;
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
    ADD_FAILURE() << "no job for " << owner;
    return {};
  }

  void ExpectNothingCanBeWrittenWith(const Lease& lost) {
    const JobRecord before = *store_->Get("a1");
    for (const Write& write : AllWrites()) {
      const absl::Status status = write.call(*leases_, lost);
      EXPECT_EQ(status.code(), absl::StatusCode::kAborted) << write.name;
      EXPECT_EQ(Reason(status), "LEASE_LOST") << write.name;
    }
    const JobRecord after = *store_->Get("a1");
    EXPECT_EQ(after.state, before.state);
    EXPECT_EQ(after.last_event, before.last_event);
    EXPECT_EQ(after.kept, before.kept);
    EXPECT_EQ(after.progress, before.progress);
    EXPECT_EQ(after.report, before.report);
    EXPECT_EQ(after.lease_expires_ms, before.lease_expires_ms);
  }

  TempDir dir_;
  DataDir data_ = *DataDir::Open(dir_.path());
  std::unique_ptr<BlobStore> blobs_ = *OpenDiskBlobStore(data_.blobs());
  std::unique_ptr<Leases> leases_;
  std::unique_ptr<Jobs> jobs_;
};

TEST_F(FencingConformance, WorkerThatSleptThroughItsLeaseCanWriteNothingMore) {
  const Lease lost = Acquire("w1");
  const Lease held = Acquire("w2");  // once the first has run out
  EXPECT_EQ(held.job.attempt, 2);
  ExpectNothingCanBeWrittenWith(lost);
  EXPECT_TRUE(leases_->Keep(held, kNew, 5).ok());
  ExpectNothingCanBeWrittenWith(lost);
  EXPECT_TRUE(leases_->Succeed(held, ReconstructReport(), kNew).ok());
  ExpectNothingCanBeWrittenWith(lost);
  EXPECT_EQ(store_->Get("a1")->kept, Encode(kNew));
}

TEST_F(FencingConformance, LeaseOfBeforeACancellationIsLostEvenToTheSameWorker) {
  const Lease lost = Acquire("w1");
  ASSERT_TRUE(jobs_->Cancel("a1").ok());
  ASSERT_TRUE(leases_->Stopped(lost).ok());
  ASSERT_TRUE(jobs_->Resume("a1").ok());
  std::this_thread::sleep_for(std::chrono::milliseconds(2));
  const Lease held = Acquire("w1");
  ASSERT_EQ(held.job.attempt, lost.job.attempt);
  ExpectNothingCanBeWrittenWith(lost);
  EXPECT_TRUE(leases_->Heartbeat(held, 0).ok());
}

TEST_F(FencingConformance, LeaseOfADeletedJobIsLost) {
  const Lease lost = Acquire("w1");
  ASSERT_TRUE(store_->Update("a1", [](JobTransaction& job) { return job.Remove(); }).ok());
  for (const Write& write : AllWrites()) {
    EXPECT_EQ(Reason(write.call(*leases_, lost)), "LEASE_LOST") << write.name;
  }
}

TEST_F(FencingConformance, BytesThatAreNoTextAreReplacedInLogAndError) {
  const Lease lease = Acquire("w1");
  const std::string raw("f\xfcr\0 all", 8), readable = "f\uFFFDr\uFFFD all";
  const absl::Status logged =
      leases_->AddLog(lease, {{0, store_->NowMs(), LogSeverity::kInfo, raw}});
  EXPECT_TRUE(logged.ok()) << logged;
  EXPECT_EQ(store_->Log("a1", 0, 9)->back().text, readable);
  const absl::Status failed = leases_->Fail(lease, InvalidInput("COLMAP_FAILED", raw, raw));
  EXPECT_TRUE(failed.ok()) << failed;
  const JobError error = *Decode<JobError>(store_->Get("a1")->error);
  EXPECT_EQ(error.message, readable);
  EXPECT_EQ(error.detail.field, readable);
  EXPECT_EQ(store_->Log("a1", 0, 9)->back().text, "FAILED: " + readable);
}

TEST_F(FencingConformance, LeaseThatIsRenewedInTimeIsKept) {
  // So long that no stall of a commit costs the lease.
  constexpr int64_t kLongLeaseMs = 3000;
  leases_ = std::make_unique<Leases>(store_.get(), blobs_.get(), LeaseOptions{kLongLeaseMs, 3});
  const Lease lease = Acquire("w1");
  const auto end = std::chrono::steady_clock::now() + std::chrono::milliseconds(kLongLeaseMs + 500);
  while (std::chrono::steady_clock::now() < end) {
    ASSERT_TRUE(leases_->Heartbeat(lease, 0).ok());
    ASSERT_FALSE(leases_->Acquire("w2")->has_value());
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
}

}  // namespace
}  // namespace litags
