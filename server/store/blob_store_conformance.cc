// What every blob store must do, whatever keeps it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "engine/core/error_test_util.h"
#include "engine/core/temp_dir_test_util.h"
#include "server/store/digest.h"
#include "server/store/upload_chunks.h"
#include "server/testing/blob_store_kind.h"

namespace litags {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::UnorderedElementsAre;

class BlobStoreConformance : public ::testing::Test {
 protected:
  void SetUp() override {
    blobs_ = MakeTestedBlobStore(dir_.path());
    if (!blobs_) GTEST_SKIP() << "this kind of blob store is not installed here";
  }

  std::string WriteFile(const std::string& name, const std::string& bytes) {
    const std::string path = dir_.path() + "/" + name;
    std::ofstream(path, std::ios::binary) << bytes;
    return path;
  }
  std::string ReadFile(const std::string& name) {
    std::ifstream file(dir_.path() + "/" + name, std::ios::binary);
    return std::string(std::istreambuf_iterator<char>(file), {});
  }

  TempDir dir_;
  std::unique_ptr<BlobStore> blobs_;
};

TEST_F(BlobStoreConformance, WhatWasPutIsReadFetchedAndRemoved) {
  const std::string bytes("a\0b", 3);
  ASSERT_TRUE(blobs_->Put("jobs/1/aa", bytes).ok());
  ASSERT_TRUE(blobs_->Put("jobs/1/aa", bytes).ok());
  ASSERT_TRUE(blobs_->Put("jobs/2/aa", "other").ok());
  EXPECT_EQ(*blobs_->Get("jobs/1/aa"), bytes);
  EXPECT_TRUE(*blobs_->Has("jobs/1/aa"));
  EXPECT_FALSE(*blobs_->Has("jobs/1/bb"));
  EXPECT_FALSE(*blobs_->Has("jobs/none/aa"));
  ASSERT_TRUE(blobs_->Fetch("jobs/1/aa", dir_.path() + "/fetched").ok());
  EXPECT_EQ(ReadFile("fetched"), bytes);
  ASSERT_TRUE(blobs_->RemoveFolder("jobs/1").ok());
  EXPECT_EQ(Reason(blobs_->Get("jobs/1/aa").status()), "BLOB_NOT_FOUND");
  EXPECT_EQ(Reason(blobs_->Fetch("jobs/1/aa", dir_.path() + "/again")), "BLOB_NOT_FOUND");
  EXPECT_FALSE(std::filesystem::exists(dir_.path() + "/again"));
  EXPECT_EQ(*blobs_->Get("jobs/2/aa"), "other");
  EXPECT_TRUE(blobs_->RemoveFolder("jobs/none").ok());
  ASSERT_TRUE(blobs_->Remove("jobs/2/aa").ok());
  EXPECT_TRUE(blobs_->Remove("jobs/2/aa").ok());
  EXPECT_EQ(Reason(blobs_->Get("jobs/2/aa").status()), "BLOB_NOT_FOUND");
}

TEST_F(BlobStoreConformance, EmptyBlobIsABlob) {
  ASSERT_TRUE(blobs_->Put("jobs/1/empty", "").ok());
  const auto read = blobs_->Get("jobs/1/empty");
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_EQ(*read, "");
  EXPECT_TRUE(blobs_->Fetch("jobs/1/empty", dir_.path() + "/fetched").ok());
}

TEST_F(BlobStoreConformance, PutFileConsumesTheFile) {
  ASSERT_TRUE(blobs_->PutFile("jobs/1/bb", WriteFile("staged", "hello")).ok());
  EXPECT_FALSE(std::filesystem::exists(dir_.path() + "/staged"));
  EXPECT_EQ(*blobs_->Get("jobs/1/bb"), "hello");
}

TEST_F(BlobStoreConformance, LargeBlobsComeBackAsTheyWere) {
  // Beyond two parts of an upload in parts, and no multiple of their size.
  std::string bytes;
  for (uint32_t i = 0, x = 1; i < 11'000'000; ++i) {
    x = x * 1664525 + 1013904223;
    bytes.push_back(static_cast<char>(x >> 24));
  }
  const std::string key = "jobs/1/" + Sha256::Hex(bytes);
  const absl::Status stored = blobs_->PutFile(key, WriteFile("staged", bytes));
  ASSERT_TRUE(stored.ok()) << stored;
  ASSERT_TRUE(blobs_->Fetch(key, dir_.path() + "/fetched").ok());
  EXPECT_TRUE(ReadFile("fetched") == bytes);
  EXPECT_TRUE(*blobs_->Get(key) == bytes);
  ASSERT_TRUE(blobs_->Link(key, "jobs/2/copy").ok());
  EXPECT_TRUE(*blobs_->Get("jobs/2/copy") == bytes);
}

TEST_F(BlobStoreConformance, LinkedBlobOutlivesTheFirst) {
  ASSERT_TRUE(blobs_->Put("jobs/1/aa", "bytes").ok());
  ASSERT_TRUE(blobs_->Link("jobs/1/aa", "jobs/2/aa").ok());
  EXPECT_TRUE(blobs_->Link("jobs/1/aa", "jobs/2/aa").ok());
  ASSERT_TRUE(blobs_->RemoveFolder("jobs/1").ok());
  EXPECT_EQ(*blobs_->Get("jobs/2/aa"), "bytes");
  EXPECT_EQ(Reason(blobs_->Link("jobs/1/aa", "jobs/3/aa")), "BLOB_NOT_FOUND");
}

TEST_F(BlobStoreConformance, ABlobMayBeLinkedToItself) {
  EXPECT_EQ(Reason(blobs_->Link("jobs/1/aa", "jobs/1/aa")), "BLOB_NOT_FOUND");
  ASSERT_TRUE(blobs_->Put("jobs/1/aa", "bytes").ok());
  const absl::Status linked = blobs_->Link("jobs/1/aa", "jobs/1/aa");
  EXPECT_TRUE(linked.ok()) << linked;
  EXPECT_EQ(*blobs_->Get("jobs/1/aa"), "bytes");
}

TEST_F(BlobStoreConformance, FoldersAreListedByTheirOwnNames) {
  EXPECT_THAT(*blobs_->List("jobs"), IsEmpty());
  for (const char* key : {"jobs/1/aa", "jobs/1/bb", "jobs/12/aa"}) {
    ASSERT_TRUE(blobs_->Put(key, "x").ok());
  }
  EXPECT_THAT(*blobs_->List("jobs"), UnorderedElementsAre("1", "12"));
  EXPECT_THAT(*blobs_->List("jobs/1"), UnorderedElementsAre("aa", "bb"));
  ASSERT_TRUE(blobs_->RemoveFolder("jobs/1").ok());
  EXPECT_THAT(*blobs_->List("jobs/12"), ElementsAre("aa"));
}

TEST_F(BlobStoreConformance, ChunksOfAnUploadAreReadAsFarAsTheyHang) {
  const UploadChunks chunks(blobs_.get(), 4);
  EXPECT_EQ(*chunks.Size("a1", "ff"), 0);
  ASSERT_TRUE(chunks.Put("a1", "ff", 4, "4567").ok());
  EXPECT_EQ(*chunks.Size("a1", "ff"), 0) << "the beginning is not there";
  ASSERT_TRUE(chunks.Put("a1", "ff", 0, "0123").ok());
  ASSERT_TRUE(chunks.Put("a1", "ff", 2, "2345").ok());
  ASSERT_TRUE(chunks.Put("a1", "ff", 12, "cdef").ok());
  EXPECT_EQ(*chunks.Size("a1", "ff"), 8);
  std::string rest;
  const auto take = [&](std::string_view bytes) {
    rest += bytes;
    return absl::OkStatus();
  };
  ASSERT_TRUE(chunks.Read("a1", "ff", 3, take).ok());
  EXPECT_EQ(rest, "34567");
  EXPECT_THAT(*chunks.Jobs(), ElementsAre("a1"));
  ASSERT_TRUE(chunks.Remove("a1", "ff").ok());
  EXPECT_EQ(*chunks.Size("a1", "ff"), 0);
  ASSERT_TRUE(chunks.Put("a1", "ff", 0, "0").ok());
  ASSERT_TRUE(chunks.RemoveJob("a1").ok());
  EXPECT_THAT(*chunks.Jobs(), IsEmpty());
}

TEST_F(BlobStoreConformance, QuietIsAFolderThatNothingCameTo) {
  EXPECT_GT(*blobs_->QuietSeconds("jobs/1"), 1e9);
  ASSERT_TRUE(blobs_->Put("jobs/1/aa", "x").ok());
  EXPECT_LT(*blobs_->QuietSeconds("jobs/1"), 60);  // generous: two clocks and a busy machine
}

}  // namespace
}  // namespace litags
