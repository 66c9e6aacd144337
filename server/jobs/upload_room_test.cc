#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "absl/strings/str_cat.h"
#include "engine/core/error_test_util.h"
#include "server/jobs/jobs.h"
#include "server/jobs/uploads_test_util.h"

namespace litags {
namespace {

using ::testing::HasSubstr;

// How much a job and an owner may have.
using UploadRoomTest = UploadsTest;

TEST_F(UploadRoomTest, WhatHasComeOfFilesCountsAgainstTheOwnersBytes) {
  const auto alice = jobs_->For({.owner = "alice", .max_bytes = 1000});
  const auto bob = jobs_->For({.owner = "bob", .max_bytes = 1000});
  const std::string first = alice->Create({})->id, second = alice->Create({})->id;
  const FileRecord broken = Photo("broken.jpg", std::string(800, 'x'));
  ASSERT_TRUE((*alice->uploads().Open(first, broken, 0))->Append(std::string(600, 'x')).ok());

  const FileRecord other = Photo("other.jpg", std::string(500, 'y'));
  for (const std::string& id : {first, second}) {
    const absl::Status refused = alice->uploads().Open(id, other, 0).status();
    EXPECT_EQ(refused.code(), absl::StatusCode::kResourceExhausted);
    EXPECT_EQ(Reason(refused), "BYTE_QUOTA_REACHED");
    EXPECT_THAT(std::string(refused.message()), HasSubstr("would hold 1100 bytes"));
  }
  EXPECT_TRUE(bob->uploads().Open(bob->Create({})->id, other, 0).ok());
  EXPECT_TRUE(jobs_->For({.owner = "alice"})->uploads().Open(second, other, 0).ok());  // no limit

  // What is there of a file is not counted twice when the rest of it comes.
  auto rest = alice->uploads().Open(first, broken, 600);
  ASSERT_TRUE(rest.ok()) << rest.status();
  ASSERT_TRUE((*rest)->Append(std::string(200, 'x')).ok());
  ASSERT_TRUE(alice->uploads().Add(first, broken, (*rest)->path()).ok());
  EXPECT_EQ(Reason(alice->uploads().Open(second, other, 0).status()), "BYTE_QUOTA_REACHED");
  ASSERT_TRUE(alice->Delete(first).ok());
  EXPECT_TRUE(alice->uploads().Open(second, other, 0).ok());
}

TEST_F(UploadRoomTest, StreamsAtTheSameTimeGetNoMoreThanTheOwnersBytes) {
  constexpr int kThreads = 6;
  const auto alice = jobs_->For({.owner = "alice", .max_bytes = 1000});
  const std::string id = alice->Create({})->id;
  std::vector<absl::StatusOr<std::unique_ptr<PartialFile>>> opened(kThreads);
  {
    std::vector<std::jthread> threads;
    for (int i = 0; i < kThreads; ++i) {
      threads.emplace_back([&, i] {
        opened[i] = alice->uploads().Open(
            id, Photo(absl::StrCat(i, ".jpg"), std::string(400, static_cast<char>('a' + i))), 0);
      });
    }
  }
  int taken = 0;
  for (auto& file : opened) {
    EXPECT_EQ(Reason(file.status()), file.ok() ? "" : "BYTE_QUOTA_REACHED");
    taken += file.ok();
  }
  EXPECT_EQ(taken, 2);
  // A stream that ends before it sent a byte makes room.
  opened.clear();
  EXPECT_TRUE(alice->uploads().Open(id, Photo("big.jpg", std::string(1000, 'z')), 0).ok());
}

TEST_F(UploadRoomTest, FilesAndBytesOfAJobAreBoundedThoseOnTheirWayIncluded) {
  UploadLimits limits;
  limits.max_files = 2;
  limits.max_job_bytes = 100;
  Restart(limits);
  const std::string id = NewJob();
  ASSERT_TRUE(Add(id, "a.jpg", "aaa").ok());
  {
    auto coming = *uploads().Open(id, Photo("b.jpg", "bbbb"), 0);
    ASSERT_TRUE(coming->Append("bb").ok());
  }
  EXPECT_EQ(Reason(Add(id, "c.jpg", "ccc")), "TOO_MANY_FILES");
  ASSERT_TRUE(Add(id, "b.jpg", "bbbb").ok());
  EXPECT_EQ(Reason(Add(id, "c.jpg", "ccc")), "TOO_MANY_FILES");
  // What is replaced is there until the job is started.
  EXPECT_EQ(Reason(Add(id, "b.jpg", std::string(94, 'b'))), "JOB_TOO_LARGE");
  EXPECT_TRUE(Add(id, "b.jpg", std::string(93, 'b')).ok());
}

TEST_F(UploadRoomTest, ReplacedBytesCountAgainstTheOwnersUntilTheyAreGone) {
  const auto alice = jobs_->For({.owner = "alice", .max_bytes = 1000});
  const std::string id = alice->Create({})->id;
  const auto add = [&](const std::string& job, char byte) -> absl::Status {
    const FileRecord file = Photo("a.jpg", std::string(400, byte));
    LITAGS_ASSIGN_OR_RETURN(auto partial, alice->uploads().Open(job, file, 0));
    LITAGS_RETURN_IF_ERROR(partial->Append(std::string(400, byte)));
    return alice->uploads().Add(job, file, partial->path());
  };
  ASSERT_TRUE(add(id, 'x').ok());
  ASSERT_TRUE(add(id, 'y').ok());
  EXPECT_EQ(Reason(add(id, 'z')), "BYTE_QUOTA_REACHED");
  EXPECT_EQ(alice->Get(id)->bytes, 400);  // of the job's own files
  ASSERT_TRUE(alice->Cancel(id).ok());
  ASSERT_TRUE(sweeper_->Sweep().ok());
  EXPECT_TRUE(add(alice->Create({})->id, 'z').ok());
}

TEST_F(UploadRoomTest, AFileThatIsRemovedAndSentAgainCountsOnce) {
  UploadLimits limits;
  limits.max_job_bytes = 1000;
  Restart(limits);
  const std::string id = NewJob(), bytes(300, 'x');
  for (int round = 0; round < 5; ++round) {
    ASSERT_TRUE(Add(id, "a.jpg", bytes).ok()) << round;
    EXPECT_EQ(store_->UsageOf("")->bytes, 300);
    ASSERT_TRUE(*uploads().Remove(id, FileRole::kPhoto, "a.jpg"));
    EXPECT_EQ(store_->UsageOf("")->bytes, 300);
  }
  // Nor when it is replaced, and comes back under another name.
  ASSERT_TRUE(Add(id, "a.jpg", bytes).ok());
  ASSERT_TRUE(Add(id, "a.jpg", std::string(200, 'y')).ok());
  EXPECT_EQ(store_->UsageOf("")->bytes, 500);
  ASSERT_TRUE(Add(id, "b.jpg", bytes).ok());
  EXPECT_EQ(store_->UsageOf("")->bytes, 500);
  // Bytes that the job still has under another name are no waste.
  ASSERT_TRUE(*uploads().Adopt(id, Photo("c.jpg", bytes)));
  ASSERT_TRUE(*uploads().Remove(id, FileRole::kPhoto, "b.jpg"));
  EXPECT_EQ(store_->Get(id)->unreferenced_bytes, 0);
}

}  // namespace
}  // namespace litags
