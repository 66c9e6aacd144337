// What is acknowledged is on disk, and would outlast a power cut.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>

#include "engine/core/sync_test_util.h"
#include "engine/core/temp_dir_test_util.h"
#include "server/store/blob_store.h"
#include "server/store/job_store.h"
#include "server/store/partial_files.h"

namespace litags {
namespace {

using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::StartsWith;

class Sync : public ::testing::Test {
 protected:
  TempDir dir_;
  const std::string path_ = std::filesystem::canonical(dir_.path());
};

TEST_F(Sync, CommitsAreOnDisk) {
  const auto store = *OpenSqliteJobStore(path_ + "/jobs.db");
  const auto nothing = [](JobTransaction&) { return absl::OkStatus(); };
  JobRecord job;
  job.id = "a1";
  Synced().Take();
  ASSERT_TRUE(store->Create(job, nothing).ok());
  EXPECT_THAT(Synced().Take(), Contains(path_ + "/jobs.db-wal"));
  ASSERT_TRUE(store
                  ->Update("a1",
                           [](JobTransaction& t) {
                             return t.AddEvent({0, 1, EventKind::kState, "x"});
                           })
                  .ok());
  EXPECT_THAT(Synced().Take(), Contains(path_ + "/jobs.db-wal"));
}

TEST_F(Sync, BlobsAreOnDiskWithTheirNames) {
  const auto blobs = *OpenDiskBlobStore(path_);
  Synced().Take();
  ASSERT_TRUE(blobs->Put("jobs/1/aa", "x").ok());
  // The new folders' names, the content before it has its name, the name.
  EXPECT_THAT(Synced().Take(), ElementsAre(path_ + "/jobs", path_, StartsWith(path_ + "/tmp/put-"),
                                           path_ + "/jobs/1"));
  ASSERT_TRUE(blobs->Link("jobs/1/aa", "jobs/1/bb").ok());
  EXPECT_THAT(Synced().Take(), ElementsAre(path_ + "/jobs/1"));
}

TEST_F(Sync, BytesOfAnUploadAreOnDiskBeforeTheyAreAnnounced) {
  PartialFiles files(path_);
  ASSERT_TRUE((*files.Open("job", "aa", 10, 0))->Append("0123").ok());
  Synced().Take();
  EXPECT_EQ(*files.Size("job", "aa", 10), 4);
  EXPECT_THAT(Synced().Take(), ElementsAre(path_ + "/job/aa"));
}

}  // namespace
}  // namespace litags
