#include "server/jobs/uploads.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <optional>
#include <vector>

#include "absl/strings/str_cat.h"
#include "engine/core/error_test_util.h"
#include "engine/core/temp_dir_test_util.h"
#include "server/jobs/jobs.h"
#include "server/jobs/jobs_test_util.h"
#include "server/jobs/leases.h"
#include "server/jobs/uploads_test_util.h"
#include "server/store/digest.h"
#include "server/testing/faulty_blob_store.h"
#include "server/testing/forwarding_job_store.h"

namespace litags {
namespace {

namespace fs = std::filesystem;

// What is read of the store: rows of files, sums over all jobs of an owner, looks for bytes.
class CountingJobStore : public ForwardingJobStore {
 public:
  explicit CountingJobStore(JobStore* store) : ForwardingJobStore(store) {}
  struct Reads {
    int64_t rows = 0, usages = 0, looks = 0;
  } reads;
  absl::StatusOr<OwnerUsage> UsageOf(std::string_view owner) override {
    ++reads.usages;
    return ForwardingJobStore::UsageOf(owner);
  }
  absl::StatusOr<std::optional<JobFile>> FindFile(std::string_view id, FileRole role,
                                                  std::string_view sha256) override {
    ++reads.looks;
    return ForwardingJobStore::FindFile(id, role, sha256);
  }
  absl::StatusOr<std::vector<FileRecord>> Files(std::string_view id) override {
    auto files = ForwardingJobStore::Files(id);
    if (files.ok()) reads.rows += static_cast<int64_t>(files->size());
    return files;
  }
  absl::StatusOr<JobRecord> Update(std::string_view id, Change change) override {
    return ForwardingJobStore::Update(id, [&](JobTransaction& job) {
      Transaction counting(&job, &reads);
      const absl::Status status = change(counting);
      job.job = counting.job;
      return status;
    });
  }

 private:
  // Of jobs that take files: without events.
  class Transaction : public JobTransaction {
   public:
    Transaction(JobTransaction* inner, Reads* reads) : inner_(inner), reads_(reads) {
      job = inner->job;
    }
    absl::StatusOr<std::vector<FileRecord>> Files() override {
      auto files = inner_->Files();
      if (files.ok()) reads_->rows += static_cast<int64_t>(files->size());
      return files;
    }
    absl::StatusOr<std::optional<FileRecord>> File(FileRole role, std::string_view name) override {
      return inner_->File(role, name);
    }
    absl::StatusOr<FileTally> Tally(std::string_view sha256) override {
      return inner_->Tally(sha256);
    }
    int64_t Bytes() const override {
      inner_->job = job;
      return inner_->Bytes();
    }
    absl::StatusOr<OwnerUsage> Usage() override {
      ++reads_->usages;
      inner_->job = job;
      return inner_->Usage();
    }
    absl::Status PutFile(const FileRecord& file) override { return inner_->PutFile(file); }
    absl::Status RemoveFile(FileRole role, std::string_view name) override {
      return inner_->RemoveFile(role, name);
    }
    absl::Status RemoveFiles(FileRole role) override { return inner_->RemoveFiles(role); }
    absl::Status AddEvent(const EventRecord&) override { return absl::UnimplementedError(""); }
    absl::Status AddLog(const LogEntry&) override { return absl::UnimplementedError(""); }
    absl::Status Remove() override { return absl::UnimplementedError(""); }

   private:
    JobTransaction* const inner_;
    Reads* const reads_;
  };
};

TEST_F(UploadsTest, AFileComesInWithoutALookAtTheRowsOfTheOthers) {
  CountingJobStore store(store_.get());
  Jobs jobs(&store, blobs_.get(), data_, clock_);
  const std::string id = NewJob();
  for (int i = 0; i < 10; ++i) {
    const std::string bytes = absl::StrCat("photo ", i / 2);  // two of each
    const FileRecord file = Photo(absl::StrCat(i, ".jpg"), bytes);
    EXPECT_FALSE((*jobs.uploads().Query(id, {file}))[0].stored);
    EXPECT_FALSE(*jobs.uploads().IsStored(id, file));
    auto partial = *jobs.uploads().Open(id, file, 0);
    ASSERT_TRUE(partial->Append(bytes).ok());
    ASSERT_TRUE(jobs.uploads().Add(id, file, partial->path()).ok());
  }
  ASSERT_TRUE(*jobs.uploads().Remove(id, FileRole::kPhoto, "0.jpg"));
  EXPECT_EQ(store_->Get(id)->unreferenced_bytes, 0);
  ASSERT_TRUE(*jobs.uploads().Remove(id, FileRole::kPhoto, "1.jpg"));
  EXPECT_EQ(store_->Get(id)->unreferenced_bytes, 7);
  EXPECT_EQ(store.reads.rows, 0);
  EXPECT_EQ(store.reads.looks, 10 + 10);  // when it is asked for, and when it is stored
}

TEST_F(UploadsTest, WithoutAQuotaNoFileAsksWhatItsOwnerHas) {
  CountingJobStore store(store_.get());
  Jobs jobs(&store, blobs_.get(), data_, clock_);
  const std::string id = NewJob();
  const auto add = [&](Jobs& to, const std::string& name) -> absl::Status {
    const FileRecord file = Photo(name, name);
    LITAGS_ASSIGN_OR_RETURN(auto partial, to.uploads().Open(id, file, 0));
    LITAGS_RETURN_IF_ERROR(partial->Append(name));
    return to.uploads().Add(id, file, partial->path());
  };
  for (const char* name : {"a.jpg", "b.jpg", "c.jpg"}) ASSERT_TRUE(add(jobs, name).ok());
  EXPECT_EQ(store.reads.usages, 0);
  // With one, whatever adds nothing does not, either.
  const auto limited = jobs.For({.owner = "", .max_bytes = 1000});
  const auto rename = [](JobDetails& details) {
    details.display_name = "night";
    return absl::OkStatus();
  };
  ASSERT_TRUE(limited->Update(id, "", rename).ok());
  ASSERT_TRUE(*limited->uploads().Remove(id, FileRole::kPhoto, "a.jpg"));
  EXPECT_EQ(store.reads.usages, 0);
  ASSERT_TRUE(add(*limited, "d.jpg").ok());
  EXPECT_EQ(store.reads.usages, 3);  // before its bytes come, are stored, and are the job's
}

TEST_F(UploadsTest, AnArchiveOfWhichAFileWasDeletedIsUnpackedAgain) {
  const std::string id = NewJob();
  const FileRecord archive = Photo("capture.zip", "zip", FileRole::kArchive);
  ASSERT_TRUE(Add(id, "7.jpg", "seven").ok());
  ASSERT_TRUE(Add(id, "8.jpg", "eight").ok());
  ASSERT_TRUE(uploads().NoteArchive(id, archive).ok());
  EXPECT_FALSE(*uploads().Remove(id, FileRole::kPhoto, "9.jpg"));
  EXPECT_TRUE(*uploads().IsStored(id, archive));
  EXPECT_TRUE(*uploads().Remove(id, FileRole::kPhoto, "7.jpg"));
  EXPECT_FALSE(*uploads().IsStored(id, archive));
  EXPECT_FALSE((*uploads().Query(id, {archive}))[0].stored);
  EXPECT_TRUE(*uploads().IsStored(id, Photo("8.jpg", "eight")));
}

TEST_F(UploadsTest, BytesOfABrokenStreamAreContinuedAlsoAfterARestart) {
  const std::string id = NewJob();
  const FileRecord file = Photo("a.jpg", "0123456789");
  ASSERT_TRUE((*uploads().Open(id, file, 0))->Append("0123").ok());  // and the stream breaks
  EXPECT_EQ(OffsetOf(id, file), 4);
  Restart({});
  EXPECT_EQ(OffsetOf(id, file), 4);
  auto rest = uploads().Open(id, file, 4);
  ASSERT_TRUE(rest.ok()) << rest.status();
  ASSERT_TRUE((*rest)->Append("456789").ok());
  EXPECT_EQ(*(*rest)->HexDigest(), file.sha256);  // of all bytes, the earlier ones included
  ASSERT_TRUE(uploads().Add(id, file, (*rest)->path()).ok());
  EXPECT_TRUE((*uploads().Query(id, {file}))[0].stored);
  EXPECT_EQ(*blobs_->Get(BlobKey(id, file.sha256)), "0123456789");
}

TEST_F(UploadsTest, OffsetBeyondWhatIsThereIsRefusedAndASmallerOneDropsTheRest) {
  const std::string id = NewJob();
  const FileRecord file = Photo("a.jpg", "0123456789");
  ASSERT_TRUE((*uploads().Open(id, file, 0))->Append("0123").ok());
  EXPECT_EQ(Reason(uploads().Open(id, file, 5).status()), "OFFSET_INVALID");
  EXPECT_EQ(OffsetOf(id, file), 4);  // the refusal cost nothing
  auto again = uploads().Open(id, file, 2);
  ASSERT_TRUE(again.ok());
  EXPECT_EQ((*again)->size(), 2);
  ASSERT_TRUE((*again)->Append("23456789").ok());
  EXPECT_EQ(*(*again)->HexDigest(), file.sha256);
  EXPECT_EQ(Reason(uploads().Open(id, Photo("b.jpg", "b"), 1).status()), "OFFSET_INVALID");
}

TEST_F(UploadsTest, NewestStreamTakesAFileOverAndTheOlderOneWritesNothingMore) {
  const std::string id = NewJob();
  const FileRecord file = Photo("a.jpg", "0123456789");
  auto old_stream = *uploads().Open(id, file, 0);
  ASSERT_TRUE(old_stream->Append("0123").ok());
  auto new_stream = *uploads().Open(id, file, 4);
  EXPECT_EQ(Reason(old_stream->Append("xxxx")), "UPLOAD_TAKEN_OVER");
  old_stream->Discard();  // has no say any more
  old_stream.reset();
  ASSERT_TRUE(new_stream->Append("456789").ok());
  EXPECT_EQ(OffsetOf(id, file), 10);
}

// A resumed upload is read for its digest in parts, and not under a lock: nothing waits for 8 GiB.
TEST_F(UploadsTest, WhatCameOfALargeFileIsReadInPartsAndNotAfterACancel) {
  const std::string id = NewJob();
  const int64_t bytes = int64_t{8} << 30;
  const FileRecord file{"a.tar", FileRole::kArchive, bytes + 1, Sha256::Hex("a"), 0, 0};
  const std::string path = (*uploads().Open(id, file, 0))->path();
  std::ofstream(path) << "x";
  fs::resize_file(path, bytes);  // sparse
  auto stream = uploads().Open(id, file, bytes);
  ASSERT_TRUE(stream.ok()) << stream.status();
  EXPECT_FALSE(*(*stream)->CatchUp(1 << 20));
  EXPECT_FALSE(*(*stream)->CatchUp(1 << 20));
  ASSERT_TRUE(jobs_->Cancel(id).ok());
  EXPECT_EQ(Reason((*stream)->CatchUp(1 << 20).status()), "UPLOAD_TAKEN_OVER");
}

TEST_F(UploadsTest, AStreamThatLostItsFileWhileItCaughtUpSaysSo) {
  const std::string id = NewJob();
  const FileRecord file = Photo("a.jpg", "0123456789");
  ASSERT_TRUE((*uploads().Open(id, file, 0))->Append("01234567").ok());
  auto late = *uploads().Open(id, file, 8);
  auto now = *uploads().Open(id, file, 2);  // cuts what the other one is about to read
  EXPECT_EQ(Reason(late->CatchUp(100).status()), "UPLOAD_TAKEN_OVER");
  EXPECT_EQ(Reason(late->Append("89")), "UPLOAD_TAKEN_OVER");
  ASSERT_TRUE(now->Append("23456789").ok());
  EXPECT_EQ(*now->HexDigest(), file.sha256);
}

TEST_F(UploadsTest, AnotherServerGoesOnAtTheLastChunk) {
  UploadLimits limits;
  limits.chunk_bytes = 4;
  Restart(limits);
  const std::string id = NewJob();
  const FileRecord file = Photo("a.jpg", "0123456789abcdef");
  auto here = *uploads().Open(id, file, 0);
  for (const char* bytes : {"01234", "567", "89a"}) ASSERT_TRUE(here->Append(bytes).ok());
  EXPECT_EQ(OffsetOf(id, file), 11);

  TempDir elsewhere;
  const DataDir other_data = *DataDir::Open(elsewhere.path());
  Jobs other(store_.get(), blobs_.get(), other_data, clock_, limits);
  Sweeper sweeper(store_.get(), blobs_.get(), &other.uploads(), other_data, clock_);
  EXPECT_EQ((*other.uploads().Query(id, {file}))[0].offset, 8);
  EXPECT_EQ(Reason(other.uploads().Open(id, file, 11).status()), "OFFSET_INVALID");
  auto there = other.uploads().Open(id, file, 8);
  ASSERT_TRUE(there.ok()) << there.status();
  ASSERT_TRUE((*there)->Append("89abcd").ok());
  // Back to the first, which has fewer bytes of its own than are known by now.
  EXPECT_EQ(OffsetOf(id, file), 12);
  here = *uploads().Open(id, file, 12);
  ASSERT_TRUE(here->Append("cdef").ok());
  EXPECT_EQ(*here->HexDigest(), file.sha256);
  ASSERT_TRUE(uploads().Add(id, file, here->path()).ok());
  here->Discard();
  EXPECT_TRUE(blobs_->List("uploads/" + id)->empty() ||
              blobs_->List("uploads/" + id + "/" + (*blobs_->List("uploads/" + id))[0])->empty());
  EXPECT_EQ(*blobs_->Get(BlobKey(id, file.sha256)), "0123456789abcdef");
  // What the other one still has goes when the job does not take files any more.
  ASSERT_TRUE((*there)->Append("ef").ok());
  ASSERT_TRUE(jobs_->Cancel(id).ok());
  ASSERT_TRUE(sweeper.Sweep().ok());
  EXPECT_TRUE(blobs_->List("uploads")->empty());
  EXPECT_TRUE(fs::is_empty(other_data.uploads()));
}

// Counts calls.
class CountingBlobStore : public FaultyBlobStore {
 public:
  using FaultyBlobStore::FaultyBlobStore;
  int calls = 0;
  absl::StatusOr<std::vector<std::string>> List(std::string_view prefix) override {
    ++calls;
    return FaultyBlobStore::List(prefix);
  }
  absl::Status Remove(std::string_view key) override {
    ++calls;
    return FaultyBlobStore::Remove(key);
  }
  absl::Status RemoveFolder(std::string_view prefix) override {
    ++calls;
    return FaultyBlobStore::RemoveFolder(prefix);
  }
};

TEST_F(UploadsTest, FilesThatComeAfterOneWasRemovedListNoBlobs) {
  CountingBlobStore blobs(blobs_.get());
  Jobs jobs(store_.get(), &blobs, data_, clock_);
  const std::string id = NewJob();
  ASSERT_TRUE(Add(id, "a.jpg", "a.jpg").ok());
  ASSERT_TRUE(*uploads().Remove(id, FileRole::kPhoto, "a.jpg"));
  for (int i = 0; i < 10; ++i) {
    const std::string name = absl::StrCat(i, ".jpg");
    ASSERT_TRUE(AddFile(jobs, data_, id, name, name).ok());
  }
  EXPECT_EQ(store_->Get(id)->unreferenced_bytes, 5);
  EXPECT_EQ(blobs.calls, 0);
}

TEST_F(UploadsTest, NobodyWaitsForTheBlobStoreToStartOrCancelAJob) {
  UploadLimits limits;
  limits.chunk_bytes = 4;
  CountingBlobStore blobs(blobs_.get());
  Jobs jobs(store_.get(), &blobs, data_, clock_, limits);
  Sweeper sweeper(store_.get(), &blobs, &jobs.uploads(), data_, clock_);
  const auto job_with_chunks = [&] {
    const std::string id = NewJob();
    for (const char* name : {"a.jpg", "b.jpg", "c.jpg"}) EXPECT_TRUE(Add(id, name, name).ok());
    auto coming = *jobs.uploads().Open(id, Photo("d.jpg", "0123456789"), 0);
    EXPECT_TRUE(coming->Append("012345").ok());
    EXPECT_EQ(blobs_->List("uploads/" + id)->size(), 1u);
    return id;
  };
  const std::string started = job_with_chunks(), cancelled = job_with_chunks();
  blobs.calls = 0;
  EXPECT_TRUE(jobs.Start(started).ok());
  EXPECT_TRUE(jobs.Cancel(cancelled).ok());
  EXPECT_EQ(blobs.calls, 0);
  EXPECT_TRUE(fs::is_empty(data_.uploads()));
  ASSERT_TRUE(sweeper.Sweep().ok());
  EXPECT_TRUE(blobs_->List("uploads")->empty());
}

TEST_F(UploadsTest, ChunksOfNoJobAreCollectedAndSmallFilesHaveNone) {
  UploadLimits limits;
  limits.chunk_bytes = 4;
  limits.keep_seconds = 0;
  Restart(limits);
  const std::string id = NewJob();
  ASSERT_TRUE((*uploads().Open(id, Photo("a.jpg", "012"), 0))->Append("01").ok());
  EXPECT_TRUE(blobs_->List("uploads")->empty());
  ASSERT_TRUE(blobs_->Put("uploads/0123456789abcdef/aa/0-4", "lost").ok());
  ASSERT_TRUE(sweeper_->Sweep().ok());
  EXPECT_FALSE(blobs_->Get("uploads/0123456789abcdef/aa/0-4").ok());
}

TEST_F(UploadsTest, SameBytesAreStoredOnceAndSentOnceForAllJobs) {
  const std::string first = NewJob(), second = NewJob();
  const std::string bytes(100'000, 'x');
  const FileRecord file = Photo("a.jpg", bytes);
  ASSERT_TRUE(Add(first, "a.jpg", bytes).ok());
  FileRecord renamed = file;
  renamed.name = "b.jpg";
  EXPECT_EQ(OffsetOf(second, renamed), 100'000);
  const auto adopted = uploads().Adopt(second, renamed);
  ASSERT_TRUE(adopted.ok() && *adopted) << adopted.status();
  EXPECT_EQ(jobs_->Get(second)->photos, 1);
  // A job that sends them all the same shares them, too: hard links to the same bytes.
  const std::string third = NewJob();
  ASSERT_TRUE(Add(third, "c.jpg", bytes).ok());
  const fs::path blob = fs::path(data_.blobs()) / BlobKey(third, file.sha256);
  EXPECT_EQ(fs::hard_link_count(blob), 3u);
  ASSERT_TRUE(jobs_->Delete(first).ok());
  EXPECT_EQ(blobs_->Get(BlobKey(second, file.sha256))->size(), 100'000u);
  // Another role or size is another file.
  EXPECT_EQ(OffsetOf(third, Photo("a.png", bytes, FileRole::kDepth)), 0);
  EXPECT_FALSE(*uploads().Adopt(third, Photo("d.jpg", "other")));
}

TEST_F(UploadsTest, ReplacedBytesStayWhileAnotherServerMayComeToNameThemAndGoAfter) {
  const std::string id = NewJob();
  ASSERT_TRUE(Add(id, "a.jpg", "first").ok());
  ASSERT_TRUE(Add(id, "a.jpg", "other one").ok());
  ASSERT_TRUE(sweeper_->Sweep().ok());
  EXPECT_EQ(*blobs_->Get(BlobKey(id, Sha256::Hex("first"))), "first");
  ASSERT_TRUE(jobs_->Cancel(id).ok());
  ASSERT_TRUE(sweeper_->Sweep().ok());
  EXPECT_EQ(BytesOnDisk(), 9);
  EXPECT_EQ(*blobs_->Get(BlobKey(id, Sha256::Hex("other one"))), "other one");
  EXPECT_TRUE(store_->JobsWithUnreferencedBlobs(10)->empty());
}

TEST_F(UploadsTest, AFileWhoseBytesAnotherJobLostIsSentAgainAndGivesThemBack) {
  const std::string first = NewJob(), second = NewJob(), third = NewJob();
  const FileRecord file = Photo("a.jpg", "0123456789");
  ASSERT_TRUE(Add(first, "a.jpg", "0123456789").ok());
  ASSERT_TRUE(blobs_->Remove(BlobKey(first, file.sha256)).ok());
  EXPECT_EQ(OffsetOf(second, file), 0);
  EXPECT_FALSE(*uploads().Adopt(second, file));
  ASSERT_TRUE(Add(second, "a.jpg", "0123456789").ok());
  for (const std::string& id : {first, second}) {
    EXPECT_EQ(*blobs_->Get(BlobKey(id, file.sha256)), "0123456789");
  }
  EXPECT_EQ(OffsetOf(third, file), 10);
}

TEST_F(UploadsTest, RefusedFilesAreNotStored) {
  const std::string id = NewJob();
  ASSERT_TRUE(Add(id, "one.json", "{}", FileRole::kCameras).ok());
  EXPECT_EQ(Reason(Add(id, "two.json", "[]", FileRole::kCameras)), "CAMERAS_TWICE");
  EXPECT_EQ(BytesOnDisk(), 2);
}

TEST_F(UploadsTest, CancelDeleteAndStartEndUploadsAndLeaveNothingOfThem) {
  for (const std::string how : {"cancel", "delete", "start"}) {
    const std::string id = NewJob();
    ASSERT_TRUE(Add(id, "a.jpg", "a" + how).ok());
    ASSERT_TRUE(Add(id, "b.jpg", "b" + how).ok());
    ASSERT_TRUE(Add(id, "c.jpg", "c" + how).ok());
    const FileRecord file = Photo("d.jpg", "0123456789");
    auto stream = *uploads().Open(id, file, 0);
    ASSERT_TRUE(stream->Append("0123").ok());
    const absl::Status ended = how == "cancel"   ? jobs_->Cancel(id).status()
                               : how == "delete" ? jobs_->Delete(id)
                                                 : jobs_->Start(id).status();
    ASSERT_TRUE(ended.ok()) << how << ": " << ended;
    EXPECT_EQ(Reason(stream->Append("456789")), "UPLOAD_TAKEN_OVER") << how;
    EXPECT_FALSE(uploads().Open(id, file, 0).ok()) << how;
    stream.reset();
    EXPECT_TRUE(fs::is_empty(data_.uploads())) << how;
  }
}

TEST_F(UploadsTest, DiskUseAfterManyBrokenUploadsReturnsToZero) {
  for (int i = 0; i < 20; ++i) {
    const std::string id = NewJob();
    ASSERT_TRUE(Add(id, "a.jpg", absl::StrCat("photo ", i)).ok());
    ASSERT_TRUE((*uploads().Open(id, Photo("b.jpg", absl::StrCat("0123456789", i)), 0))
                    ->Append("0123")
                    .ok());
  }
  EXPECT_GT(BytesOnDisk(), 0);
  now_ms_ += 23 * 3600 * 1000;
  EXPECT_EQ(sweeper_->Sweep()->size(), 0u);
  now_ms_ += 2 * 3600 * 1000;
  EXPECT_EQ(sweeper_->Sweep()->size(), 20u);
  EXPECT_EQ(BytesOnDisk(), 0);
  EXPECT_TRUE(fs::is_empty(data_.uploads()));
  EXPECT_TRUE(jobs_->List(0, "", 100)->empty());
}

TEST_F(UploadsTest, SignsOfLifeKeepAnUploadAndAStartedJobNeverExpires) {
  const std::string alive = NewJob(), open = NewJob(), started = NewJob();
  ASSERT_TRUE(Add(started, "a.jpg", "a").ok());
  ASSERT_TRUE(Add(started, "b.jpg", "b").ok());
  ASSERT_TRUE(Add(started, "c.jpg", "c").ok());
  ASSERT_TRUE(jobs_->Start(started).ok());
  auto stream = *uploads().Open(open, Photo("b.jpg", "0123456789"), 0);
  for (int hour = 0; hour < 40; ++hour) {
    now_ms_ += 3600 * 1000;
    ASSERT_TRUE(uploads().Check(alive).ok());
    ASSERT_EQ(sweeper_->Sweep()->size(), 0u);
  }
  stream.reset();  // the stream has ended; nothing had come for 40 hours
  EXPECT_THAT(*sweeper_->Sweep(), ::testing::ElementsAre(open));
  now_ms_ += int64_t{1000} * 3600 * 1000;
  EXPECT_THAT(*sweeper_->Sweep(), ::testing::ElementsAre(alive));
  EXPECT_EQ(jobs_->Get(started)->state, JobState::kQueued);
}

TEST_F(UploadsTest, FilesThatBelongToNoJobAreCollectedAndStrangersAreLeftAlone) {
  UploadLimits limits;
  limits.keep_seconds = 0;
  Restart(limits);
  const std::string lost = "0123456789abcdef";  // as after a crash in the middle of a deletion
  ASSERT_TRUE(blobs_->Put(BlobKey(lost, std::string(64, 'a')), "photo").ok());
  ASSERT_TRUE(blobs_->Put(BlobKey(lost, LeaseBlob(3, std::string(64, 'b'))), "scene").ok());
  fs::create_directories(data_.uploads() + "/" + lost);
  std::ofstream(data_.uploads() + "/" + lost + "/file") << "bytes";
  fs::create_directories(data_.uploads() + "/lost+found");
  std::ofstream(data_.tmp() + "/unpack-1") << "half of it";  // of a server that was killed
  ASSERT_TRUE(sweeper_->Sweep().ok());
  EXPECT_EQ(BytesOnDisk(), 0);
  EXPECT_TRUE(fs::exists(data_.uploads() + "/lost+found"));
}

TEST_F(UploadsTest, OrphansOfTodayAreKeptForTheOperator) {
  const std::string lost = "0123456789abcdef";
  ASSERT_TRUE(blobs_->Put(BlobKey(lost, std::string(64, 'a')), "photo").ok());
  std::ofstream(data_.blobs() + "/tmp/put-1") << "half";
  ASSERT_TRUE(sweeper_->Sweep().ok());
  EXPECT_EQ(BytesOnDisk(), 5 + 4);
}

}  // namespace
}  // namespace litags
