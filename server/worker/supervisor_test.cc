#include "server/worker/supervisor.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <spdlog/sinks/ostream_sink.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>
#include <fstream>
#include <iterator>
#include <sstream>
#include <thread>

#include "engine/core/temp_dir_test_util.h"
#include "server/store/data_dir.h"

namespace litags {
namespace {

using ::testing::HasSubstr;
using ::testing::StartsWith;

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

TEST(Supervisor, WorkerThatDiesYoungIsFollowedAfterTheLeastPauseAtFirst) {
  TempDir dir;
  const DataDir data = *DataDir::Open(dir.path());
  const auto store = *OpenSqliteJobStore(data.database());
  const auto blobs = *OpenDiskBlobStore(data.blobs());
  Leases leases(store.get(), blobs.get());
  SupervisorOptions options;
  options.command = {"/bin/sh", "-c", "echo $1 >> " + dir.path() + "/names"};
  options.min_backoff_seconds = 1;
  std::ostringstream log;
  const auto usual = spdlog::default_logger();
  spdlog::set_default_logger(std::make_shared<spdlog::logger>(
      "test", std::make_shared<spdlog::sinks::ostream_sink_mt>(log)));
  const auto start = std::chrono::steady_clock::now();
  Supervisor supervisor(options, &leases);
  const auto workers = [&] {
    std::ifstream names(dir.path() + "/names");
    return std::count(std::istreambuf_iterator<char>(names), {}, '\n');
  };
  for (int i = 0; i < 500 && workers() < 2; ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - start;
  EXPECT_GE(seconds.count(), 1);
  supervisor.Stop();  // so that nobody writes to the log
  spdlog::set_default_logger(usual);
  const std::string said = log.str();
  const std::string pause = "next one in ";
  ASSERT_THAT(said, HasSubstr(pause));
  EXPECT_THAT(said.substr(said.find(pause)), StartsWith(pause + "1.0 s"));
}

}  // namespace
}  // namespace litags
