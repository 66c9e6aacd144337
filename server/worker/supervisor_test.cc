#include "server/worker/supervisor.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <fstream>
#include <thread>

#include "server/store/data_dir.h"
#include "server/testing/temp_dir.h"

namespace litags {
namespace {

using ::testing::HasSubstr;

TEST(Supervisor, WorkerThatIsKilledWhenTheServerStopsCostsItsJobNoAttempt) {
  TempDir dir;
  const DataDir data = *DataDir::Open(dir.path());
  const auto store = *OpenSqliteJobStore(data.database());
  const auto blobs = *OpenDiskBlobStore(data.blobs());
  Leases leases(store.get(), blobs.get());
  JobRecord job;
  job.id = "a1";
  job.state = JobState::kQueued;
  ASSERT_TRUE(store->Create(job, [](JobTransaction&) { return absl::OkStatus(); }).ok());

  // A worker that tells its name and does not end in time.
  const std::string name_file = dir.path() + "/name";
  SupervisorOptions options;
  options.command = {"/bin/sh", "-c",
                     "trap '' TERM; echo $1 > " + name_file + "; while :; do sleep 0.1; done"};
  options.grace_seconds = 0.3;
  Supervisor supervisor(options, &leases);
  std::string name;
  for (int i = 0; i < 500 && name.empty(); ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
    std::ifstream(name_file) >> name;
  }
  ASSERT_TRUE(leases.Acquire(name)->has_value());
  EXPECT_EQ(store->Get("a1")->attempt, 1);
  supervisor.Stop();
  EXPECT_EQ(store->Get("a1")->state, JobState::kQueued);
  EXPECT_EQ(store->Get("a1")->attempt, 0);
  EXPECT_THAT(store->Log("a1", 0, 99)->back().text, HasSubstr("the worker shut down"));
}

}  // namespace
}  // namespace litags
