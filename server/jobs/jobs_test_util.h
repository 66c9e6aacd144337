#ifndef LITAGS_SERVER_JOBS_JOBS_TEST_UTIL_H_
#define LITAGS_SERVER_JOBS_JOBS_TEST_UTIL_H_

#include <gtest/gtest.h>

#include <cstdint>
#include <fstream>
#include <memory>
#include <string>
#include <vector>

#include "server/jobs/codec.h"
#include "server/jobs/jobs.h"
#include "server/jobs/leases.h"
#include "server/jobs/state_machine.h"
#include "server/jobs/sweeper.h"
#include "server/store/digest.h"
#include "server/testing/temp_dir.h"

namespace litags {

inline const KeptFiles kScene{{kSceneFile, {"1/aa", 5}}};

// Jobs and their leases on stores in a folder of the test, with a clock that the test sets.
class JobsTest : public ::testing::Test {
 protected:
  // Stores a file of made-up content and the given picture size.
  absl::Status Add(const std::string& id, const std::string& name, int width = 64, int height = 48,
                   FileRole role = FileRole::kPhoto) {
    const std::string path = data_.tmp() + "/staged";
    std::ofstream(path) << name;
    return jobs_.uploads().Add(
        id, {name, role, static_cast<int64_t>(name.size()), Sha256::Hex(name), width, height},
        path);
  }

  std::string StartedJob(const JobPolicy& policy = {}) {
    NewJob wanted;
    wanted.policy = policy;
    const std::string id = jobs_.Create(wanted)->id;
    EXPECT_TRUE(Add(id, "a.jpg").ok());
    EXPECT_TRUE(Add(id, "b.jpg").ok());
    EXPECT_TRUE(Add(id, "c.jpg").ok());
    EXPECT_TRUE(jobs_.Start(id).ok());
    return id;
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
