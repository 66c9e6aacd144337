#include <gtest/gtest.h>

#include <filesystem>

#include "server/testing/blob_store_kind.h"
#include "server/testing/temp_dir.h"

namespace litags {

std::unique_ptr<BlobStore> MakeTestedBlobStore(const std::string& dir) {
  return *OpenDiskBlobStore(dir + "/blobs");
}

namespace {

TEST(DiskBlobStore, NothingTemporaryIsLeft) {
  TempDir dir;
  const auto blobs = MakeTestedBlobStore(dir.path());
  ASSERT_TRUE(blobs->Put("jobs/1/cc", "x").ok());
  EXPECT_TRUE(std::filesystem::is_empty(dir.path() + "/blobs/tmp"));
}

}  // namespace
}  // namespace litags
