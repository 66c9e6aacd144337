// What the server says of its health while the store or the workers fail.
#include <gtest/gtest.h>

#include <atomic>
#include <filesystem>
#include <thread>

#include "engine/core/error.h"
#include "engine/core/temp_dir_test_util.h"
#include "server/api/health_monitor.h"
#include "server/testing/forwarding_job_store.h"

namespace litags {
namespace {

// A store whose disk can be taken away.
class FailingStore : public ForwardingJobStore {
 public:
  explicit FailingStore(JobStore* store) : ForwardingJobStore(store) {}

  absl::StatusOr<std::vector<JobRecord>> List(int64_t after_time_ms, std::string_view after_id,
                                              int limit, const std::optional<std::string>& owner,
                                              ListOrder order) override {
    if (fails) {
      return MakeError(absl::StatusCode::kInternal, "STORE_FAILED", "", "the disk is gone");
    }
    return ForwardingJobStore::List(after_time_ms, after_id, limit, owner, order);
  }

  absl::Status CheckWritable() override {
    return only_reads ? absl::UnavailableError("it only reads") : absl::OkStatus();
  }

  std::atomic<bool> fails{false}, only_reads{false};
};

class NotedServer : public Server {
 public:
  int port() const override { return 0; }
  std::string own_address() const override { return ""; }
  std::shared_ptr<grpc::Channel> InProcessChannel() override { return nullptr; }
  SharedRoom* unread() override { return nullptr; }
  Metrics* metrics() override { return &metrics_; }
  void SetHealth(const Health& health) override {
    store = health.store;
    workers = health.workers;
    ++looks;
  }
  void Shutdown() override {}

  std::atomic<bool> store{false}, workers{false};
  std::atomic<int> looks{0};

 private:
  Metrics metrics_;
};

class HealthTest : public ::testing::Test {
 protected:
  // Two looks from now on: the first may have begun before.
  void WaitForALook() {
    const int until = server_.looks + 2;
    while (server_.looks < until) std::this_thread::yield();
  }

  TempDir dir_;
  DataDir data_ = *DataDir::Open(dir_.path());
  std::unique_ptr<JobStore> sqlite_ = *OpenSqliteJobStore(data_.database());
  FailingStore store_{sqlite_.get()};
  std::unique_ptr<BlobStore> blobs_ = *OpenDiskBlobStore(data_.blobs());
  Jobs jobs_{&store_, blobs_.get(), data_};
  LocalFolders folders_ = StorePlaces().LocalFolders(data_);
  NotedServer server_;
  std::atomic<bool> workers_fail_{false};
};

TEST_F(HealthTest, FollowsTheStoreAndTheWorkers) {
  const HealthMonitor monitor(
      &jobs_, folders_, [this] { return workers_fail_.load(); }, &server_, 0.01);
  WaitForALook();
  EXPECT_TRUE(server_.store && server_.workers);
  store_.fails = true;
  WaitForALook();
  EXPECT_TRUE(!server_.store && server_.workers);
  store_.fails = false;
  workers_fail_ = true;
  WaitForALook();
  EXPECT_TRUE(server_.store && !server_.workers);
  workers_fail_ = false;
  WaitForALook();
  EXPECT_TRUE(server_.store && server_.workers);
}

TEST_F(HealthTest, StoreThatOnlyReadsIsNotWell) {
  store_.only_reads = true;
  EXPECT_FALSE(CheckStoreHealth(&jobs_, folders_).ok());
  store_.only_reads = false;
  EXPECT_TRUE(CheckStoreHealth(&jobs_, folders_).ok());
}

TEST_F(HealthTest, StoreWhoseFolderIsGoneIsNotWell) {
  EXPECT_TRUE(CheckStoreHealth(&jobs_, folders_).ok());
  std::filesystem::remove_all(data_.root);
  const absl::Status status = CheckStoreHealth(&jobs_, folders_);
  EXPECT_EQ(status.code(), absl::StatusCode::kInternal) << status;
  EXPECT_EQ(GetErrorDetail(status)->reason, "STORE_FAILED");
}

TEST_F(HealthTest, EachFolderThatTakesBytesIsLookedAt) {
  TempDir blobs, jobs;
  StorePlaces places;
  places.blobs = "file://" + blobs.path() + "/gone";
  places.jobs = "sqlite://" + jobs.path() + "/jobs.db";
  const absl::Status no_blobs = CheckStoreHealth(&jobs_, places.LocalFolders(data_));
  ASSERT_FALSE(no_blobs.ok());
  EXPECT_EQ(GetErrorDetail(no_blobs)->field, "--blobs");
  std::filesystem::create_directory(blobs.path() + "/gone");
  EXPECT_TRUE(CheckStoreHealth(&jobs_, places.LocalFolders(data_)).ok());
  std::filesystem::remove_all(jobs.path());
  const absl::Status no_jobs = CheckStoreHealth(&jobs_, places.LocalFolders(data_));
  ASSERT_FALSE(no_jobs.ok());
  EXPECT_EQ(GetErrorDetail(no_jobs)->field, "--store");
  places.jobs = "postgresql://db";
  places.blobs = "s3://bucket";
  EXPECT_EQ(places.LocalFolders(data_).size(), 1u);
}

}  // namespace
}  // namespace litags
