// An installation of SQLite and a folder moved to PostgreSQL and another folder, or S3, and back:
// nothing is lost, and what is interrupted goes on.
#include "server/jobs/move.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <fstream>

#include "absl/strings/str_cat.h"
#include "engine/core/error_test_util.h"
#include "engine/core/temp_dir_test_util.h"
#include "server/jobs/jobs.h"
#include "server/jobs/kept_files.h"
#include "server/jobs/leases.h"
#include "server/store/digest.h"
#include "server/testing/postgres_server.h"
#include "server/testing/s3_server.h"

namespace litags {
namespace {

namespace fs = std::filesystem;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr int kBlobs = 5;  // of each of the two jobs that have some

class Move : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!SharedPostgres()) GTEST_SKIP() << "PostgreSQL is not installed here";
    to_.jobs = *SharedPostgres()->NewDatabase();
    to_.blobs = "file://" + dir_.path() + "/there";
    const auto store = *OpenJobStore(from_, data_);
    const auto blobs = *OpenBlobStore(from_, data_);
    // Every field that has another default, long texts, words of other scripts.
    for (const char* id : {"00000000000000a1", "00000000000000a2", "00000000000000a3"}) {
      JobRecord job;
      job.id = id;
      job.owner = "alice";
      job.request_id = absl::StrCat("request of ", id);
      job.display_name = "Höhle 'dunkel' \\ 📷";
      job.create_time_ms = 1000 + id[15];
      job.options = std::string(100'000, 'o');
      job.state = JobState::kSucceeded;
      job.needs = "{\"cores\":2}";
      ASSERT_TRUE(store->Create(job, [&](JobTransaction& t) { return Fill(t, *blobs); }).ok());
    }
    ASSERT_TRUE(store->Create(Empty(), [](JobTransaction&) { return absl::OkStatus(); }).ok());
  }

  static JobRecord Empty() {
    JobRecord job;
    job.id = "00000000000000a4";
    job.create_time_ms = 1;
    return job;
  }

  // Photos, blobs of a lease, and events.
  static absl::Status Fill(JobTransaction& job, BlobStore& blobs) {
    for (int i = 0; i < kBlobs; ++i) {
      const std::string bytes = absl::StrCat("bytes ", i, " of ", job.job.id);
      const std::string digest = Sha256::Hex(bytes);
      const std::string blob = i % 2 ? LeaseBlob(i, digest) : digest;
      LITAGS_RETURN_IF_ERROR(blobs.Put(BlobKey(job.job.id, blob), bytes));
      LITAGS_RETURN_IF_ERROR(job.PutFile({absl::StrCat("p", i, ".jpg"), FileRole::kPhoto,
                                          static_cast<int64_t>(bytes.size()), digest, 4, 3}));
      LITAGS_RETURN_IF_ERROR(job.AddEvent({0, 50 + i, EventKind::kProgress, "{\"p\":\"ä\"}"}));
    }
    return absl::OkStatus();
  }

  absl::StatusOr<MoveSummary> MoveTo(const StorePlaces& to) {
    return MoveInstallation(from_, to, data_, [](const std::string&) {});
  }

  // What the interfaces tell of all jobs, in words.
  std::string AllOf(const StorePlaces& places) const {
    const auto store = *OpenJobStore(places, data_);
    const auto blobs = *OpenBlobStore(places, data_);
    std::string all;
    const auto jobs = store->List(0, "", 100).value();
    for (const JobRecord& job : jobs) {
      absl::StrAppend(&all, job.id, " ", job.owner, " ", job.request_id, " ", job.display_name, " ",
                      job.options, " ", job.needs, " ", job.photos, " ", job.bytes, " ",
                      job.last_event, "\n");
      const auto files = store->Files(job.id).value();
      for (const FileRecord& file : files) {
        absl::StrAppend(&all, file.name, " ", file.sha256, " ", file.size_bytes, "\n");
      }
      const auto events = store->Events(job.id, 0, 100).value();
      for (const EventRecord& event : events) {
        absl::StrAppend(&all, event.number, " ", event.time_ms, " ", event.payload, "\n");
      }
      for (int i = 0; i < kBlobs; ++i) {
        const std::string digest = Sha256::Hex(absl::StrCat("bytes ", i, " of ", job.id));
        const auto bytes = blobs->Get(BlobKey(job.id, i % 2 ? LeaseBlob(i, digest) : digest));
        absl::StrAppend(&all, bytes.ok() ? *bytes : "none", "\n");
      }
    }
    return all;
  }

  std::string IdOf(const StorePlaces& places) const {
    return (*OpenJobStore(places, data_))->InstallationId().value();
  }

  fs::path SomeBlob() const {
    std::vector<fs::path> files;
    for (const auto& entry : fs::recursive_directory_iterator(data_.blobs() + "/jobs")) {
      if (entry.is_regular_file()) files.push_back(entry.path());
    }
    std::sort(files.begin(), files.end());
    return files.at(files.size() / 2);
  }

  TempDir dir_;
  DataDir data_ = *DataDir::Open(dir_.path() + "/data");
  StorePlaces from_, to_;
};

TEST_F(Move, EverythingIsThereAfterwardsAndTheSourceIsAsItWas) {
  const std::string before = AllOf(from_);
  const auto moved = MoveTo(to_);
  ASSERT_TRUE(moved.ok()) << moved.status();
  EXPECT_EQ(moved->rows.at("jobs").rows, 4);
  EXPECT_EQ(moved->rows.at("files").rows, 3 * kBlobs);
  EXPECT_EQ(moved->rows.at("events").rows, 3 * kBlobs);
  EXPECT_EQ(moved->blobs, 3 * kBlobs);
  EXPECT_EQ(moved->blobs_copied, 3 * kBlobs);
  EXPECT_TRUE(AllOf(to_) == before);
  EXPECT_TRUE(AllOf(from_) == before);
  EXPECT_EQ(before.find("none\nbytes"), std::string::npos);
  // From there to a third place, of the first kind again.
  StorePlaces back;
  back.jobs = "sqlite://" + dir_.path() + "/back.db";
  back.blobs = "file://" + dir_.path() + "/back";
  const auto again = MoveInstallation(to_, back, data_, [](const std::string&) {});
  ASSERT_TRUE(again.ok()) << again.status();
  EXPECT_EQ(again->rows, moved->rows);
  EXPECT_TRUE(AllOf(back) == before);
}

TEST_F(Move, EverythingIsInS3Afterwards) {
  if (!SharedS3()) GTEST_SKIP() << "no S3 server is installed here";
  const S3Options s3 = SharedS3()->Options();
  setenv("AWS_ACCESS_KEY_ID", s3.access_key.c_str(), 1);
  setenv("AWS_SECRET_ACCESS_KEY", s3.secret_key.c_str(), 1);
  to_.blobs = absl::StrCat("s3://", s3.bucket, "/", s3.prefix);
  to_.s3_endpoint = s3.endpoint;
  const std::string before = AllOf(from_);
  const auto moved = MoveTo(to_);
  ASSERT_TRUE(moved.ok()) << moved.status();
  EXPECT_TRUE(AllOf(to_) == before);
  EXPECT_THAT(*(*OpenBlobStore(to_, data_))->List("installation"), ElementsAre(IdOf(from_)));
}

// On one file system the target could share the source's files: nothing would be there twice.
TEST_F(Move, TargetHasFilesOfItsOwn) {
  ASSERT_TRUE(MoveTo(to_).ok());
  int files = 0;
  for (const auto& entry : fs::recursive_directory_iterator(dir_.path() + "/there/jobs")) {
    if (!entry.is_regular_file()) continue;
    ++files;
    EXPECT_EQ(entry.hard_link_count(), 1u) << entry.path();
  }
  EXPECT_EQ(files, 3 * kBlobs);
  EXPECT_TRUE(fs::is_empty(data_.tmp()));
}

TEST_F(Move, SourceIsNoTarget) {
  const std::string before = AllOf(from_);
  const auto refusal = [&](const StorePlaces& to) { return MoveTo(to).status(); };
  fs::create_symlink(data_.root, dir_.path() + "/link");
  for (const std::string& path : {data_.database(), dir_.path() + "/link/litags.db"}) {
    const absl::Status refused = refusal({"sqlite://" + path, to_.blobs, ""});
    EXPECT_EQ(Reason(refused), "TARGET_NOT_EMPTY") << path;
    EXPECT_THAT(std::string(refused.message()), HasSubstr("--to-store is the store that is moved"));
  }
  for (const std::string& path : {data_.blobs(), dir_.path() + "/link/blobs"}) {
    const absl::Status refused = refusal({to_.jobs, "file://" + path, ""});
    EXPECT_EQ(Reason(refused), "TARGET_NOT_EMPTY") << path;
    EXPECT_THAT(std::string(refused.message()), HasSubstr("--to-blobs is the store that is moved"));
  }
  EXPECT_TRUE(AllOf(from_) == before);
  EXPECT_FALSE(fs::exists(data_.blobs() + "/move"));
  ASSERT_TRUE(MoveTo(to_).ok());
  from_ = to_;
  const std::string same = absl::StrCat(to_.jobs, "&application_name=another");
  EXPECT_EQ(Reason(refusal({same, "file://" + dir_.path() + "/elsewhere", ""})),
            "TARGET_NOT_EMPTY");
}

// As with another --data than the server's: all rows would be there, and no file.
TEST_F(Move, SourceWithoutTheFilesOfItsRowsIsRefused) {
  const DataDir other = *DataDir::Open(dir_.path() + "/other");
  const StorePlaces from = {"sqlite://" + data_.database(), "", ""};
  EXPECT_EQ(Reason(MoveInstallation(from, to_, other, [](const std::string&) {}).status()),
            "BLOBS_NOT_MARKED");
}

TEST_F(Move, TargetBecomesTheSameInstallation) {
  const std::string id = IdOf(from_);
  EXPECT_NE(IdOf(to_), id) << "a server was tried there";
  ASSERT_TRUE(MoveTo(to_).ok());
  EXPECT_EQ(IdOf(to_), id);
  EXPECT_THAT(*(*OpenBlobStore(to_, data_))->List("installation"), ElementsAre(id));
  ASSERT_TRUE(MoveTo(to_).ok()) << "compared";
  EXPECT_EQ(IdOf(from_), id);
}

TEST_F(Move, BlobsOfAnotherInstallationAreLeftAlone) {
  const auto blobs = *OpenBlobStore(to_, data_);
  ASSERT_TRUE(blobs->Put("installation/0123456789abcdef0123456789abcdef", "x").ok());
  EXPECT_EQ(Reason(MoveTo(to_).status()), "BLOBS_OF_ANOTHER_INSTALLATION");
  EXPECT_TRUE(blobs->List("jobs")->empty());
}

TEST_F(Move, DamagedBlobStopsItBeforeARowIsThereAndWithTheRightOneItGoesOn) {
  const fs::path victim = SomeBlob();
  fs::rename(victim, dir_.path() + "/kept");
  std::ofstream(victim) << "damaged";
  const auto stopped = MoveTo(to_);
  EXPECT_EQ(Reason(stopped.status()), "BLOB_DAMAGED");
  EXPECT_THAT(std::string(stopped.status().message()), HasSubstr(victim.filename().string()));
  EXPECT_TRUE((*OpenJobStore(to_, data_))->List(0, "", 10)->empty());
  fs::rename(dir_.path() + "/kept", victim);
  const auto moved = MoveTo(to_);
  ASSERT_TRUE(moved.ok()) << moved.status();
  EXPECT_LT(moved->blobs_copied, 3 * kBlobs);
  EXPECT_TRUE(AllOf(to_) == AllOf(from_));
  const auto compared = MoveTo(to_);
  ASSERT_TRUE(compared.ok()) << compared.status();
  EXPECT_EQ(compared->blobs_copied, 0);
  EXPECT_EQ(compared->rows, moved->rows);
}

TEST_F(Move, TargetWithOtherJobsIsLeftAlone) {
  ASSERT_TRUE(MoveTo(to_).ok());
  const auto store = *OpenJobStore(to_, data_);
  const auto rename = [](JobTransaction& job) {
    job.job.display_name = "since renamed";
    return absl::OkStatus();
  };
  ASSERT_TRUE(store->Update(Empty().id, rename).ok());
  EXPECT_EQ(Reason(MoveTo(to_).status()), "TARGET_NOT_EMPTY");
  EXPECT_EQ(store->Get(Empty().id)->display_name, "since renamed");
}

TEST_F(Move, SourceWithAWorkerOrALeaseIsRefused) {
  const auto store = *OpenJobStore(from_, data_);
  ASSERT_TRUE(store->PutWorker({"w", store->NowMs(), "{}"}).ok());
  EXPECT_EQ(Reason(MoveTo(to_).status()), "SOURCE_IN_USE");
  ASSERT_TRUE(store->RemoveWorker("w").ok());
  const auto lease = [&](int64_t end_ms) {
    return store->Update(Empty().id, [&](JobTransaction& job) {
      job.job.state = JobState::kRunning;
      job.job.lease_expires_ms = end_ms;
      return absl::OkStatus();
    });
  };
  ASSERT_TRUE(lease(store->NowMs() + 60'000).ok());
  EXPECT_EQ(Reason(MoveTo(to_).status()), "SOURCE_IN_USE");
  ASSERT_TRUE(lease(store->NowMs() - 1).ok()) << "a worker that was killed";
  EXPECT_TRUE(MoveTo(to_).ok());
}

// As by a server that has no workers. The blobs of a job made meanwhile would be left behind.
TEST_F(Move, SourceThatChangesMeanwhileIsRefusedBeforeARowIsThere) {
  const auto store = *OpenJobStore(from_, data_);
  const auto add = [&](const std::string&) {
    JobRecord job = Empty();
    job.id = "00000000000000a5";
    EXPECT_TRUE(store->Create(job, [](JobTransaction&) { return absl::OkStatus(); }).ok());
  };
  EXPECT_EQ(Reason(MoveInstallation(from_, to_, data_, add).status()), "COPY_DIFFERS");
  EXPECT_TRUE((*OpenJobStore(to_, data_))->List(0, "", 10)->empty());
}

TEST_F(Move, FolderWithoutAnInstallationIsNoneThatCouldBeMoved) {
  const DataDir empty = *DataDir::Open(dir_.path() + "/typo");
  EXPECT_EQ(Reason(MoveInstallation({}, to_, empty, [](const std::string&) {}).status()),
            "SOURCE_NOT_FOUND");
}

}  // namespace
}  // namespace litags
