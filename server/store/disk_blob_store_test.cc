#include <gtest/gtest.h>
#include <signal.h>
#include <sys/resource.h>

#include <cerrno>
#include <filesystem>
#include <fstream>

#include "engine/core/temp_dir_test_util.h"
#include "server/store/file_error.h"
#include "server/testing/blob_store_kind.h"

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

TEST(CopyFile, SaysWhyItFailedAndLeavesNothingThen) {
  TempDir dir;
  const std::string source = dir.path() + "/source", target = dir.path() + "/target";
  std::ofstream(source) << std::string(3'000'000, 'x');
  // A limit of the size of files stands in for a full disk: the first part of the file fits.
  signal(SIGXFSZ, SIG_IGN);
  rlimit limit = {};
  ASSERT_EQ(getrlimit(RLIMIT_FSIZE, &limit), 0);
  rlimit small = limit;
  small.rlim_cur = 1'500'000;
  ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &small), 0);
  EXPECT_EQ(CopyFile(source, target), EFBIG);
  ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &limit), 0);
  EXPECT_FALSE(std::filesystem::exists(target));
  EXPECT_EQ(CopyFile(dir.path() + "/none", target), ENOENT);
  EXPECT_FALSE(std::filesystem::exists(target));
  EXPECT_EQ(CopyFile(source, target), 0);
  EXPECT_EQ(std::filesystem::file_size(target), 3'000'000u);
  EXPECT_EQ(CopyFile(source, target), EEXIST);
  EXPECT_TRUE(std::filesystem::exists(target)) << "not ours to remove";
}

TEST(DiskBlobStore, TemporaryFilesAreRemovedWhenTheyAreAbandonedAndNoOthers) {
  TempDir dir;
  const auto blobs = MakeTestedBlobStore(dir.path());
  const std::filesystem::path tmp = dir.path() + "/blobs/tmp";
  for (const char* name : {"put-1", "strangers"}) std::ofstream(tmp / name) << "x";
  blobs->RemoveTemporary();
  EXPECT_TRUE(std::filesystem::exists(tmp / "put-1"));  // another server may be writing it
  (*OpenDiskBlobStore(dir.path() + "/blobs", /*abandoned_seconds=*/-1))->RemoveTemporary();
  EXPECT_FALSE(std::filesystem::exists(tmp / "put-1"));
  EXPECT_TRUE(std::filesystem::exists(tmp / "strangers"));
}

}  // namespace
}  // namespace litags
