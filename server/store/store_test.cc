#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "engine/core/error.h"
#include "server/store/blob_store.h"
#include "server/store/data_dir.h"
#include "server/store/digest.h"
#include "server/testing/temp_dir.h"

namespace litags {
namespace {

std::string Reason(const absl::Status& status) {
  const auto detail = GetErrorDetail(status);
  return detail ? detail->reason : "";
}

class BlobStoreTest : public ::testing::Test {
 protected:
  TempDir dir_;
  std::unique_ptr<BlobStore> blobs_ = *OpenDiskBlobStore(dir_.path() + "/blobs");
};

TEST_F(BlobStoreTest, WhatWasPutIsReadFetchedAndRemoved) {
  const std::string bytes("a\0b", 3);
  ASSERT_TRUE(blobs_->Put("jobs/1/aa", bytes).ok());
  ASSERT_TRUE(blobs_->Put("jobs/1/aa", bytes).ok());
  ASSERT_TRUE(blobs_->Put("jobs/2/aa", "other").ok());
  EXPECT_EQ(*blobs_->Get("jobs/1/aa"), bytes);
  ASSERT_TRUE(blobs_->Fetch("jobs/1/aa", dir_.path() + "/fetched").ok());
  EXPECT_EQ(std::filesystem::file_size(dir_.path() + "/fetched"), 3u);
  ASSERT_TRUE(blobs_->RemoveFolder("jobs/1").ok());
  EXPECT_EQ(Reason(blobs_->Get("jobs/1/aa").status()), "BLOB_NOT_FOUND");
  EXPECT_EQ(Reason(blobs_->Fetch("jobs/1/aa", dir_.path() + "/again")), "BLOB_NOT_FOUND");
  EXPECT_EQ(*blobs_->Get("jobs/2/aa"), "other");
  EXPECT_TRUE(blobs_->RemoveFolder("jobs/1").ok());  // removing twice is no error
  EXPECT_EQ(std::filesystem::file_size(dir_.path() + "/fetched"), 3u);
}

TEST_F(BlobStoreTest, PutFileConsumesTheFileAndLeavesNothingTemporary) {
  const std::string path = dir_.path() + "/staged";
  std::ofstream(path) << "hello";
  ASSERT_TRUE(blobs_->PutFile("jobs/1/bb", path).ok());
  EXPECT_FALSE(std::filesystem::exists(path));
  EXPECT_EQ(*blobs_->Get("jobs/1/bb"), "hello");
  ASSERT_TRUE(blobs_->Put("jobs/1/cc", "x").ok());
  EXPECT_TRUE(std::filesystem::is_empty(dir_.path() + "/blobs/tmp"));
}

TEST(Digest, KnownVectorOfSha256) {
  // FIPS 180-2, appendix B.1.
  EXPECT_EQ(Sha256::Hex("abc"), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
  Sha256 in_parts;
  in_parts.Update("a");
  in_parts.Update("bc");
  EXPECT_EQ(in_parts.HexDigest(), Sha256::Hex("abc"));
  EXPECT_EQ(RandomHex(8).size(), 16u);
  EXPECT_NE(RandomHex(8), RandomHex(8));
}

TEST(DataDirectory, IsMadePrivateAndItsTemporaryFilesAreRemoved) {
  TempDir dir;
  const auto data = DataDir::Open(dir.path() + "/a/b");
  ASSERT_TRUE(data.ok()) << data.status();
  struct stat info {};
  ASSERT_EQ(stat(data->root.c_str(), &info), 0);
  EXPECT_EQ(info.st_mode & 0777, 0700u);
  std::ofstream(data->tmp() + "/left") << "x";
  data->EmptyTmp(60);  // somebody may be writing it
  EXPECT_FALSE(std::filesystem::is_empty(data->tmp()));
  data->EmptyTmp(0);
  EXPECT_TRUE(std::filesystem::is_empty(data->tmp()));
}

TEST(DataDirectory, FileInItsPlaceIsAClearError) {
  TempDir dir;
  std::ofstream(dir.path() + "/file") << "x";
  EXPECT_EQ(Reason(DataDir::Open(dir.path() + "/file").status()), "DATA_DIR_UNUSABLE");
}

}  // namespace
}  // namespace litags
