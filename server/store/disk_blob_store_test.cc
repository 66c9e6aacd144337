#include <gtest/gtest.h>

#include <chrono>
#include <filesystem>
#include <fstream>

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

TEST(DiskBlobStore, FolderIsTheSameHoweverItIsWritten) {
  TempDir dir;
  std::string key = "jobs";
  for (const char* folder : {"/blobs/", "/blobs//", "//blobs", "/./blobs/."}) {
    key += "/a";  // a new folder for each
    const auto blobs = *OpenDiskBlobStore(dir.path() + folder);
    ASSERT_TRUE(blobs->Put(key + "/b", folder).ok()) << folder;
    EXPECT_EQ(*MakeTestedBlobStore(dir.path())->Get(key + "/b"), folder);
  }
}

TEST(DiskBlobStore, TemporaryFilesOfYesterdayAreRemoved) {
  TempDir dir;
  const auto blobs = MakeTestedBlobStore(dir.path());
  const std::filesystem::path tmp = dir.path() + "/blobs/tmp";
  for (const char* name : {"put-old", "put-new", "strangers"}) std::ofstream(tmp / name) << "x";
  const auto long_ago = std::filesystem::file_time_type::clock::now() - std::chrono::hours(25);
  for (const char* name : {"put-old", "strangers"}) {
    std::filesystem::last_write_time(tmp / name, long_ago);
  }
  blobs->RemoveTemporary();
  EXPECT_FALSE(std::filesystem::exists(tmp / "put-old"));
  EXPECT_TRUE(std::filesystem::exists(tmp / "put-new"));  // another server may be writing it
  EXPECT_TRUE(std::filesystem::exists(tmp / "strangers"));
}

}  // namespace
}  // namespace litags
