#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "engine/core/error_test_util.h"
#include "server/jobs/jobs.h"
#include "server/store/digest.h"
#include "server/testing/temp_dir.h"

namespace litags {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;

constexpr int64_t kHourMs = 3'600'000;

class SweepTest : public ::testing::Test {
 protected:
  SweepTest() { Restart({}); }

  // As a server does that starts again, by default on the same data.
  void Restart(UploadLimits limits, const std::string& database = "jobs.db") {
    jobs_.reset();
    store_ = *OpenSqliteJobStore(dir_.path() + "/" + database);
    jobs_ = std::make_unique<Jobs>(store_.get(), blobs_.get(), data_, clock_, limits);
  }

  absl::Status Add(const std::string& id, const std::string& name, const std::string& bytes) {
    const std::string path = data_.tmp() + "/staged";
    std::ofstream(path) << bytes;
    const auto size = static_cast<int64_t>(bytes.size());
    return jobs_->uploads().Add(id, {name, FileRole::kPhoto, size, Sha256::Hex(bytes), 64, 48},
                                path);
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
};

TEST_F(SweepTest, JobsThatTheStoreDoesNotKnowKeepTheirFilesForADayFromNowHoweverOldTheyAre) {
  const std::string id = jobs_->Create({})->id;
  ASSERT_TRUE(Add(id, "a.jpg", "a").ok());
  const auto days_ago = fs::file_time_type::clock::now() - std::chrono::hours(48);
  fs::last_write_time(data_.blobs() + "/jobs/" + id, days_ago);
  const auto sweep_after = [&](int hours) {
    now_ms_ += hours * kHourMs;
    ASSERT_TRUE(jobs_->Sweep().ok());
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

}  // namespace
}  // namespace litags
