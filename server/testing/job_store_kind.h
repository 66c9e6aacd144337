#ifndef LITAGS_SERVER_TESTING_JOB_STORE_KIND_H_
#define LITAGS_SERVER_TESTING_JOB_STORE_KIND_H_

#include <gtest/gtest.h>

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

#include "absl/status/statusor.h"
#include "server/store/job_store.h"

namespace litags {

// A change that changes nothing.
inline absl::Status Nothing(JobTransaction&) { return absl::OkStatus(); }

// Fits of a worker that takes any job.
inline bool FitsAny(std::string_view) { return true; }

inline JobRecord MakeJob(const std::string& id, int64_t time_ms = 1,
                         JobState state = JobState::kUploading) {
  JobRecord job;
  job.id = id;
  job.state = state;
  job.create_time_ms = time_ms;
  job.queue_time_ms = time_ms;
  return job;
}

// Of JobStoreKind::MakeOldest.
inline constexpr char kInsertOldJob[] =
    "INSERT INTO jobs (id, owner, request_id, content_digest, display_name, state, "
    "cancel_requested, attempt, priority, lease_owner, lease_start_ms, lease_expires_ms, run_ms, "
    "create_time_ms, start_time_ms, end_time_ms, queue_time_ms, expire_time_ms, last_event, "
    "photos, "
    "bytes, snapshot_iteration, options, policy, progress, error, report) VALUES "
    "('a1', 'alice', 'req', '', 'old', 2, 0, 0, 0, '', 0, 0, 0, 1, 0, 0, 1, 0, 0, 0, 0, -1, '{}', "
    "'', '', '', '')";

// One kind of job store with a place of its own, empty at first.
class JobStoreKind {
 public:
  virtual ~JobStoreKind() = default;
  // Each call opens it anew, as another process would.
  virtual absl::StatusOr<std::unique_ptr<JobStore>> Open() = 0;
  // Lays the place out as the oldest version that is read did, with the queued job "a1" of the
  // request "req" in it.
  virtual absl::Status MakeOldest() = 0;
  // Claims that a program of that version wrote it.
  virtual absl::Status SetVersion(int64_t version) = 0;
  // CheckJobStore() of the place.
  virtual absl::Status Check() = 0;
};

// The kind that a test program is linked with; null if it cannot be had on this machine.
std::unique_ptr<JobStoreKind> MakeTestedKind();

// What every kind of store must do, run with the kind that the program is linked with.
class StoreConformance : public ::testing::Test {
 protected:
  void SetUp() override {
    kind_ = MakeTestedKind();
    if (!kind_) GTEST_SKIP() << "this kind of store is not installed here";
    store_ = Open();
  }

  std::unique_ptr<JobStore> Open() {
    auto store = kind_->Open();
    EXPECT_TRUE(store.ok()) << store.status();
    return store.ok() ? *std::move(store) : nullptr;
  }

  std::unique_ptr<JobStoreKind> kind_;
  std::unique_ptr<JobStore> store_;
};

}  // namespace litags

#endif  // LITAGS_SERVER_TESTING_JOB_STORE_KIND_H_
