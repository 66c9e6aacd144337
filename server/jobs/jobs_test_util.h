#ifndef LITAGS_SERVER_JOBS_JOBS_TEST_UTIL_H_
#define LITAGS_SERVER_JOBS_JOBS_TEST_UTIL_H_

#include <gtest/gtest.h>

#include <cstdint>
#include <fstream>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "engine/core/temp_dir_test_util.h"
#include "server/jobs/codec.h"
#include "server/jobs/jobs.h"
#include "server/jobs/leases.h"
#include "server/jobs/state_machine.h"
#include "server/jobs/sweeper.h"
#include "server/store/blob_store.h"
#include "server/store/data_dir.h"
#include "server/store/digest.h"
#include "server/store/job_store.h"

namespace litags {

inline const KeptFiles kScene{{kSceneFile, {"1/aa", 5}}};

// Stores a file of made-up content and the given picture size.
inline absl::Status AddFile(Jobs& jobs, const DataDir& data, const std::string& id,
                            const std::string& name, const std::string& bytes,
                            FileRole role = FileRole::kPhoto, int width = 64, int height = 48) {
  const std::string path = data.tmp() + "/staged";
  std::ofstream(path) << bytes;
  return jobs.uploads().Add(
      id, {name, role, static_cast<int64_t>(bytes.size()), Sha256::Hex(bytes), width, height},
      path);
}

// A job with three photos, which is not started.
inline std::string UploadedJob(Jobs& jobs, const DataDir& data, const NewJob& wanted = {}) {
  const std::string id = jobs.Create(wanted)->id;
  for (const char* name : {"a.jpg", "b.jpg", "c.jpg"}) {
    EXPECT_TRUE(AddFile(jobs, data, id, name, name).ok());
  }
  return id;
}

inline std::string StartedJob(Jobs& jobs, const DataDir& data, const NewJob& wanted = {}) {
  const std::string id = UploadedJob(jobs, data, wanted);
  EXPECT_TRUE(jobs.Start(id).ok());
  return id;
}

// Jobs and their leases on stores in a folder of the test, with a clock that the test sets.
class JobsTest : public ::testing::Test {
 protected:
  absl::Status Add(const std::string& id, const std::string& name, int width = 64, int height = 48,
                   FileRole role = FileRole::kPhoto) {
    return AddFile(jobs_, data_, id, name, name, role, width, height);
  }

  std::string StartedJob(const JobPolicy& policy = {}) {
    NewJob wanted;
    wanted.policy = policy;
    return litags::StartedJob(jobs_, data_, wanted);
  }

  JobState State(const std::string& id) { return jobs_.Get(id)->state; }

  // Payloads of the job's state events, as "STATE" words.
  std::string History(const std::string& id) {
    std::string history;
    const std::vector<EventRecord> events = *jobs_.Events(id, 0, 1000);
    for (size_t i = 0; i < events.size(); ++i) {
      EXPECT_EQ(events[i].number, static_cast<int64_t>(i + 1));
      if (events[i].kind != EventKind::kState) continue;
      history += std::string(JobStateName(Decode<StateChange>(events[i].payload)->state)) + " ";
    }
    return history;
  }

  int64_t now_ms_ = 1'000'000;
  Clock clock_ = [this] { return now_ms_; };
  TempDir dir_;
  DataDir data_ = *DataDir::Open(dir_.path());
  std::unique_ptr<JobStore> store_ = *OpenSqliteJobStore(data_.database());
  std::unique_ptr<BlobStore> blobs_ = *OpenDiskBlobStore(data_.blobs());
  Jobs jobs_{store_.get(), blobs_.get(), data_, clock_};
  Sweeper sweeper_{store_.get(), blobs_.get(), &jobs_.uploads(), data_, clock_};
  Leases leases_{store_.get(), blobs_.get(), {}, clock_};
};

}  // namespace litags

#endif  // LITAGS_SERVER_JOBS_JOBS_TEST_UTIL_H_
