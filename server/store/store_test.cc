#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sqlite3.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <thread>

#include "engine/core/error.h"
#include "server/store/blob_store.h"
#include "server/store/data_dir.h"
#include "server/store/digest.h"
#include "server/store/job_store.h"
#include "server/store/sqlite_migrations.h"
#include "server/testing/temp_dir.h"

namespace litags {
namespace {

using ::testing::ElementsAre;

std::string Reason(const absl::Status& status) {
  const auto detail = GetErrorDetail(status);
  return detail ? detail->reason : "";
}

absl::Status Nothing(JobTransaction&) { return absl::OkStatus(); }

JobRecord MakeJob(const std::string& id, int64_t time_ms, JobState state = JobState::kUploading) {
  JobRecord job;
  job.id = id;
  job.state = state;
  job.create_time_ms = time_ms;
  job.queue_time_ms = time_ms;
  return job;
}

class JobStoreTest : public ::testing::Test {
 protected:
  std::unique_ptr<JobStore> Open() {
    auto store = OpenSqliteJobStore(dir_.path() + "/jobs.db");
    EXPECT_TRUE(store.ok()) << store.status();
    return *std::move(store);
  }
  TempDir dir_;
  std::unique_ptr<JobStore> store_ = Open();
};

TEST_F(JobStoreTest, EveryFieldSurvivesWritingAndReopening) {
  JobRecord job = MakeJob("a1", 1000, JobState::kRunning);
  job.owner = "alice";
  job.request_id = "req";
  job.display_name = "my \"fox\"; DROP TABLE jobs";
  job.cancel_requested = true;
  job.attempt = 2;
  job.lease_owner = "w1";
  job.lease_expires_ms = 5;
  job.start_time_ms = 6;
  job.end_time_ms = 7;
  job.snapshot_iteration = 250;
  job.scene_path = "work/a1/scene";
  job.options = "{\"o\":1}";
  job.progress = "{\"p\":1}";
  job.error = "{\"e\":1}";
  job.report = "{\"r\":1}";
  ASSERT_TRUE(store_->Create(job, Nothing).ok());
  store_ = Open();
  const auto read = store_->Get("a1");
  ASSERT_TRUE(read.ok()) << read.status();
  EXPECT_EQ(read->owner, "alice");
  EXPECT_EQ(read->request_id, job.request_id);
  EXPECT_EQ(read->display_name, job.display_name);
  EXPECT_EQ(read->state, job.state);
  EXPECT_TRUE(read->cancel_requested);
  EXPECT_EQ(read->attempt, 2);
  EXPECT_EQ(read->lease_owner, "w1");
  EXPECT_EQ(read->lease_expires_ms, 5);
  EXPECT_EQ(read->create_time_ms, 1000);
  EXPECT_EQ(read->start_time_ms, 6);
  EXPECT_EQ(read->end_time_ms, 7);
  EXPECT_EQ(read->queue_time_ms, 1000);
  EXPECT_EQ(read->snapshot_iteration, 250);
  EXPECT_EQ(read->scene_path, job.scene_path);
  EXPECT_EQ(read->options, job.options);
  EXPECT_EQ(read->progress, job.progress);
  EXPECT_EQ(read->error, job.error);
  EXPECT_EQ(read->report, job.report);
}

TEST_F(JobStoreTest, SameRequestIdReturnsTheFirstJobUnchanged) {
  JobRecord first = MakeJob("a1", 1), second = MakeJob("a2", 2);
  first.request_id = second.request_id = "same";
  ASSERT_TRUE(store_->Create(first, Nothing).ok());
  const auto made = store_->Create(second, Nothing);
  ASSERT_TRUE(made.ok());
  EXPECT_EQ(made->id, "a1");
  EXPECT_EQ(store_->Get("a2").status().code(), absl::StatusCode::kNotFound);
  // Without a request id every call makes a job.
  ASSERT_TRUE(store_->Create(MakeJob("b1", 3), Nothing).ok());
  EXPECT_EQ(store_->Create(MakeJob("b2", 4), Nothing)->id, "b2");
}

TEST_F(JobStoreTest, OwnersHaveRequestIdsListsAndSumsOfTheirOwn) {
  JobRecord hers = MakeJob("a1", 1), his = MakeJob("b1", 2), his_next = MakeJob("b2", 3);
  hers.owner = "alice";
  his.owner = his_next.owner = "bob";
  hers.request_id = his.request_id = "same";
  ASSERT_TRUE(store_->Create(hers, Nothing).ok());
  EXPECT_EQ(store_->Create(his, Nothing)->id, "b1");
  ASSERT_TRUE(store_->Create(his_next, Nothing).ok());
  const auto ids = [&](const std::optional<std::string>& owner) {
    std::vector<std::string> ids;
    const auto jobs = store_->List(0, "", 10, owner);
    for (const JobRecord& job : *jobs) ids.push_back(job.id);
    return ids;
  };
  EXPECT_THAT(ids("alice"), ElementsAre("a1"));
  EXPECT_THAT(ids("bob"), ElementsAre("b2", "b1"));
  EXPECT_THAT(ids(std::nullopt), ElementsAre("b2", "b1", "a1"));
  EXPECT_EQ(store_->List(3, "b2", 10, "bob")->at(0).id, "b1");

  OwnerUsage usage;
  const auto put = [&](JobTransaction& job) -> absl::Status {
    LITAGS_RETURN_IF_ERROR(job.PutFile({"a.jpg", FileRole::kPhoto, 7, "00", 1, 1}));
    LITAGS_ASSIGN_OR_RETURN(usage, job.Usage());
    job.job.owner = "mallory";  // ignored
    return absl::OkStatus();
  };
  for (const char* id : {"a1", "b1", "b2"}) ASSERT_TRUE(store_->Update(id, put).ok());
  EXPECT_EQ(usage.jobs, 2);    // bob's, not alice's
  EXPECT_EQ(usage.bytes, 14);  // with those of the transaction that asks
  EXPECT_EQ(store_->Get("b2")->owner, "bob");
}

TEST_F(JobStoreTest, JobsOfTheFirstVersionAreKeptAndBelongToNobody) {
  const std::string path = dir_.path() + "/old.db";
  {
    const auto old = SqliteConnection::Open(path);
    ASSERT_TRUE(old.ok());
    ASSERT_TRUE(MigrateSqlite(old->get(), 1).ok());
    ASSERT_TRUE((*old)
                    ->Execute("INSERT INTO jobs VALUES ('a1','req','old',2,0,0,'',0,1,0,0,1,0,0,"
                              "0,-1,'','{}','','','')")
                    .ok());
  }
  auto store = OpenSqliteJobStore(path);
  ASSERT_TRUE(store.ok()) << store.status();
  const auto job = (*store)->Get("a1");
  ASSERT_TRUE(job.ok()) << job.status();
  EXPECT_EQ(job->owner, "");
  EXPECT_EQ(job->request_id, "req");
  EXPECT_EQ(job->state, JobState::kQueued);
  JobRecord again = MakeJob("a2", 2);
  again.request_id = "req";
  EXPECT_EQ((*store)->Create(again, Nothing)->id, "a1");
  EXPECT_TRUE(OpenSqliteJobStore(path).ok()) << "migrating twice";
}

TEST_F(JobStoreTest, UnknownJobIsNotFoundInEveryCall) {
  for (const absl::Status& status :
       {store_->Get("none").status(), store_->Update("none", Nothing).status(),
        store_->Files("none").status(), store_->Events("none", 0, 10).status()}) {
    EXPECT_EQ(status.code(), absl::StatusCode::kNotFound);
    EXPECT_EQ(Reason(status), "JOB_NOT_FOUND");
  }
}

TEST_F(JobStoreTest, FailedChangeLeavesTheJobItsEventsAndItsFilesAsTheyWere) {
  ASSERT_TRUE(store_->Create(MakeJob("a1", 1), Nothing).ok());
  const auto status = store_->Update("a1", [](JobTransaction& job) -> absl::Status {
    job.job.state = JobState::kQueued;
    LITAGS_RETURN_IF_ERROR(job.AddEvent({0, 1, EventKind::kState, "x"}));
    LITAGS_RETURN_IF_ERROR(job.PutFile({"a.jpg", FileRole::kPhoto, 3, "00", 1, 1}));
    return absl::AbortedError("no");
  });
  EXPECT_EQ(status.status().code(), absl::StatusCode::kAborted);
  EXPECT_EQ(store_->Get("a1")->state, JobState::kUploading);
  EXPECT_EQ(store_->Get("a1")->last_event, 0);
  EXPECT_TRUE(store_->Files("a1")->empty());
  EXPECT_TRUE(store_->Events("a1", 0, 10)->empty());
}

TEST_F(JobStoreTest, EventsAreNumberedWithoutGapsWhenSeveralConnectionsWrite) {
  ASSERT_TRUE(store_->Create(MakeJob("a1", 1), Nothing).ok());
  constexpr int kWriters = 3, kEach = 15;
  std::vector<std::thread> writers;
  for (int w = 0; w < kWriters; ++w) {
    writers.emplace_back([this, w] {
      auto store = Open();  // its own connection, as in another process
      for (int i = 0; i < kEach; ++i) {
        const auto status = store->Update("a1", [&](JobTransaction& job) {
          return job.AddEvent({0, 1, EventKind::kProgress, std::to_string(w)});
        });
        EXPECT_TRUE(status.ok()) << status.status();
      }
    });
  }
  for (auto& t : writers) t.join();
  const auto events = store_->Events("a1", 0, 1000);
  ASSERT_EQ(events->size(), size_t{kWriters * kEach});
  for (size_t i = 0; i < events->size(); ++i) {
    EXPECT_EQ((*events)[i].number, static_cast<int64_t>(i + 1));
  }
  EXPECT_EQ(store_->Get("a1")->last_event, kWriters * kEach);
  const auto page = store_->Events("a1", 10, 2);
  ASSERT_EQ(page->size(), 2u);
  EXPECT_EQ((*page)[0].number, 11);
}

TEST_F(JobStoreTest, FilesAreReplacedByNameAndCounted) {
  ASSERT_TRUE(store_->Create(MakeJob("a1", 1), Nothing).ok());
  const auto put = [&](const FileRecord& file) {
    return store_->Update("a1", [&](JobTransaction& job) { return job.PutFile(file); });
  };
  ASSERT_TRUE(put({"b.jpg", FileRole::kPhoto, 10, "00", 4, 3}).ok());
  ASSERT_TRUE(put({"a.jpg", FileRole::kPhoto, 20, "11", 4, 3}).ok());
  ASSERT_TRUE(put({"a.jpg", FileRole::kDepth, 100, "22", 0, 0}).ok());
  const auto job = put({"b.jpg", FileRole::kPhoto, 30, "33", 4, 3});
  ASSERT_TRUE(job.ok());
  EXPECT_EQ(job->photos, 2);
  EXPECT_EQ(job->bytes, 150);
  EXPECT_EQ(store_->Get("a1")->bytes, 150);
  const auto files = store_->Files("a1");
  ASSERT_EQ(files->size(), 3u);
  EXPECT_EQ((*files)[0].name, "a.jpg");
  EXPECT_EQ((*files)[1].sha256, "33");
  EXPECT_EQ((*files)[1].width, 4);
  EXPECT_EQ((*files)[2].role, FileRole::kDepth);
}

TEST_F(JobStoreTest, RemoveTakesFilesAndEventsAlong) {
  ASSERT_TRUE(store_->Create(MakeJob("a1", 1), Nothing).ok());
  ASSERT_TRUE(store_
                  ->Update("a1",
                           [](JobTransaction& job) -> absl::Status {
                             LITAGS_RETURN_IF_ERROR(job.PutFile({"a", FileRole::kPhoto, 1, "0"}));
                             return job.AddEvent({0, 1, EventKind::kState, "x"});
                           })
                  .ok());
  ASSERT_TRUE(store_->Update("a1", [](JobTransaction& job) { return job.Remove(); }).ok());
  EXPECT_EQ(store_->Get("a1").status().code(), absl::StatusCode::kNotFound);
  // A new job of the same id would see leftovers.
  ASSERT_TRUE(store_->Create(MakeJob("a1", 1), Nothing).ok());
  EXPECT_TRUE(store_->Files("a1")->empty());
  EXPECT_TRUE(store_->Events("a1", 0, 10)->empty());
}

TEST_F(JobStoreTest, ListPagesNewestFirstWithoutGapOrRepeatAlsoAtEqualTimes) {
  for (const auto& [id, time] : std::vector<std::pair<std::string, int64_t>>{
           {"a", 10}, {"b", 20}, {"c", 20}, {"d", 20}, {"e", 30}}) {
    ASSERT_TRUE(store_->Create(MakeJob(id, time), Nothing).ok());
  }
  std::vector<std::string> seen;
  int64_t time = 0;
  std::string id;
  for (;;) {
    const auto page = store_->List(time, id, 2);
    ASSERT_TRUE(page.ok()) << page.status();
    if (page->empty()) break;
    for (const JobRecord& job : *page) seen.push_back(job.id);
    time = page->back().create_time_ms;
    id = page->back().id;
  }
  EXPECT_THAT(seen, ElementsAre("e", "d", "c", "b", "a"));
}

TEST_F(JobStoreTest, QueueIsFirstInFirstOutAndExpiryLooksAtTheLeaseOnly) {
  ASSERT_TRUE(store_->Create(MakeJob("late", 20, JobState::kQueued), Nothing).ok());
  ASSERT_TRUE(store_->Create(MakeJob("early", 10, JobState::kQueued), Nothing).ok());
  const auto take = [](JobTransaction& job) {
    job.job.state = JobState::kRunning;
    job.job.lease_owner = "w";
    job.job.lease_expires_ms = 100;
    return absl::OkStatus();
  };
  EXPECT_EQ((*store_->UpdateFirstQueued(take))->id, "early");
  EXPECT_EQ((*store_->UpdateFirstQueued(take))->id, "late");
  EXPECT_FALSE(store_->UpdateFirstQueued(take)->has_value());
  EXPECT_FALSE(store_->UpdateFirstExpired(100, Nothing)->has_value());
  EXPECT_TRUE(store_->UpdateFirstExpired(101, Nothing)->has_value());
  EXPECT_FALSE(store_->UpdateFirstLeasedBeyond(100, Nothing)->has_value());
  EXPECT_TRUE(store_->UpdateFirstLeasedBeyond(99, Nothing)->has_value());
  EXPECT_EQ(store_->LeasedTo("w")->size(), 2u);
  EXPECT_TRUE(store_->LeasedTo("other")->empty());
}

TEST_F(JobStoreTest, ChangeTokenMovesWithOwnAndForeignChangesOnly) {
  auto other = Open();
  const int64_t start = *store_->ChangeToken();
  EXPECT_EQ(*store_->ChangeToken(), start);
  ASSERT_TRUE(store_->Create(MakeJob("a", 1), Nothing).ok());
  const int64_t own = *store_->ChangeToken();
  EXPECT_NE(own, start);
  ASSERT_TRUE(other->Create(MakeJob("b", 1), Nothing).ok());
  const int64_t foreign = *store_->ChangeToken();
  EXPECT_NE(foreign, own);
  EXPECT_EQ(*store_->ChangeToken(), foreign);
}

TEST_F(JobStoreTest, AcknowledgedJobSurvivesKillOfItsProcess) {
  int pipe_fds[2];
  ASSERT_EQ(pipe(pipe_fds), 0);
  const pid_t child = fork();
  if (child == 0) {
    auto store = OpenSqliteJobStore(dir_.path() + "/crash.db");
    if (store.ok() && (*store)->Create(MakeJob("a1", 1), Nothing).ok()) {
      if (write(pipe_fds[1], "k", 1) == 1) pause();
    }
    _exit(1);
  }
  char ack = 0;
  ASSERT_EQ(read(pipe_fds[0], &ack, 1), 1);
  kill(child, SIGKILL);
  waitpid(child, nullptr, 0);
  close(pipe_fds[0]);
  close(pipe_fds[1]);
  auto store = OpenSqliteJobStore(dir_.path() + "/crash.db");
  ASSERT_TRUE(store.ok());
  EXPECT_TRUE((*store)->Get("a1").ok());
}

TEST_F(JobStoreTest, DatabaseOfALaterVersionIsRefused) {
  sqlite3* db = nullptr;
  ASSERT_EQ(sqlite3_open((dir_.path() + "/jobs.db").c_str(), &db), SQLITE_OK);
  ASSERT_EQ(sqlite3_exec(db, "PRAGMA user_version=99", nullptr, nullptr, nullptr), SQLITE_OK);
  sqlite3_close(db);
  EXPECT_EQ(Reason(OpenSqliteJobStore(dir_.path() + "/jobs.db").status()), "STORE_TOO_NEW");
}

TEST_F(JobStoreTest, DamagedPageIsFoundBeforeItIsServed) {
  const std::string path = dir_.path() + "/jobs.db";
  for (int i = 0; i < 200; ++i) {
    ASSERT_TRUE(store_->Create(MakeJob("job" + std::to_string(i), 1), Nothing).ok());
  }
  store_.reset();
  EXPECT_TRUE(CheckSqliteJobStore(path).ok());
  EXPECT_TRUE(CheckSqliteJobStore(dir_.path() + "/none.db").ok());
  constexpr int kPage = 4096;
  const auto pages = static_cast<int>(std::filesystem::file_size(path)) / kPage;
  ASSERT_GT(pages, 4);
  for (const int page : {0, pages / 2}) {
    std::fstream file(path, std::ios::in | std::ios::out | std::ios::binary);
    file.seekp(page * kPage);
    file << std::string(kPage, '\x5a') << std::flush;
    const absl::Status status = CheckSqliteJobStore(path);
    EXPECT_EQ(Reason(status), "STORE_CORRUPT") << page;
    EXPECT_THAT(std::string(status.message()), ::testing::HasSubstr("backup"));
    EXPECT_FALSE(OpenSqliteJobStore(path).ok() && page == 0);
  }
}

TEST_F(JobStoreTest, FolderThatDoesNotExistIsAClearError) {
  const auto store = OpenSqliteJobStore(dir_.path() + "/missing/jobs.db");
  EXPECT_EQ(Reason(store.status()), "STORE_NOT_OPENED");
  EXPECT_THAT(std::string(store.status().message()), ::testing::HasSubstr("missing/jobs.db"));
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
