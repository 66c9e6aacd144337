// Two installations that were given the same bucket and prefix by mistake: the second one does not
// start, and neither removes what the other stored. Nor does a server start without the files that
// its job store names.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <fstream>
#include <memory>

#include "absl/strings/str_cat.h"
#include "engine/core/error_test_util.h"
#include "engine/core/temp_dir_test_util.h"
#include "server/jobs/jobs.h"
#include "server/jobs/sweeper.h"
#include "server/store/digest.h"
#include "server/store/open_stores.h"
#include "server/testing/eventually.h"
#include "server/testing/faulty_blob_store.h"
#include "server/testing/postgres_server.h"
#include "server/testing/s3_server.h"
#include "server/testing/server_process.h"

namespace litags {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::UnorderedElementsAre;

constexpr char kOther[] = "0123456789abcdef0123456789abcdef";  // another installation's id

void SetS3Keys(const S3Options& s3) {
  setenv("AWS_ACCESS_KEY_ID", s3.access_key.c_str(), 1);
  setenv("AWS_SECRET_ACCESS_KEY", s3.secret_key.c_str(), 1);
}

std::string UrlOf(const S3Options& s3) { return absl::StrCat("s3://", s3.bucket, "/", s3.prefix); }

class Installation : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!SharedS3()) GTEST_SKIP() << "no S3 server is installed here";
    s3_ = SharedS3()->Options();
    SetS3Keys(s3_);
    places_ = {"", UrlOf(s3_), s3_.endpoint};
    blobs_ = *OpenS3BlobStore(s3_);
    ours_ = *OpenSqliteJobStore(dir_ / "ours.db");
    id_ = *ours_->InstallationId();
  }

  absl::Status Claim(JobStore* store) {
    return ClaimBlobs(places_, {dir_ / "data"}, store, blobs_.get()).status();
  }
  absl::Status CheckBlobs(const DataDir& data) {
    return CheckBlobsAreOurs(places_, data, blobs_.get());
  }
  std::vector<std::string> Markers() { return *blobs_->List("installation"); }
  void Mark(const std::string& id) { ASSERT_TRUE(blobs_->Put("installation/" + id, "x").ok()); }
  void Unmark(const std::string& id) { ASSERT_TRUE(blobs_->Remove("installation/" + id).ok()); }

  TempDir dir_;
  S3Options s3_;
  StorePlaces places_;
  std::unique_ptr<BlobStore> blobs_;
  std::unique_ptr<JobStore> ours_;
  std::string id_;
};

TEST_F(Installation, BlobsOfAnotherOneAreRefusedUntilItsMarkerIsRemoved) {
  ASSERT_TRUE(Claim(ours_.get()).ok());
  EXPECT_THAT(Markers(), ElementsAre(id_));
  const auto theirs = *OpenSqliteJobStore(dir_ / "theirs.db");
  const absl::Status refused = Claim(theirs.get());
  EXPECT_EQ(Reason(refused), "BLOBS_OF_ANOTHER_INSTALLATION");
  EXPECT_THAT(std::string(refused.message()),
              AllOf(HasSubstr(absl::StrCat("remove the marker s3://", s3_.bucket, "/", s3_.prefix,
                                           "installation/", id_)),
                    HasSubstr(*theirs->InstallationId())));
  EXPECT_THAT(Markers(), ElementsAre(id_));
  ours_ = *OpenSqliteJobStore(dir_ / "ours.db");
  EXPECT_TRUE(Claim(ours_.get()).ok()) << "started again";
  Unmark(id_);
  EXPECT_TRUE(Claim(theirs.get()).ok());
  EXPECT_EQ(Reason(Claim(ours_.get())), "BLOBS_OF_ANOTHER_INSTALLATION");
}

TEST_F(Installation, OfTwoThatStartAtTheSameMomentNoneGoesOn) {
  FaultyBlobStore blobs(blobs_.get());
  blobs.on_write = [&](auto) { return blobs_->Put(absl::StrCat("installation/", kOther), "x"); };
  EXPECT_EQ(Reason(ClaimBlobs(places_, {dir_ / "data"}, ours_.get(), &blobs).status()),
            "BLOBS_OF_ANOTHER_INSTALLATION");
  EXPECT_THAT(Markers(), UnorderedElementsAre(id_, kOther));
  EXPECT_EQ(Reason(Claim(ours_.get())), "BLOBS_OF_ANOTHER_INSTALLATION");
}

TEST_F(Installation, BlobsFromBeforeThereWereMarkersAreMarkedAtTheNextStart) {
  ASSERT_TRUE(blobs_->Put("jobs/1/aa", "photo").ok());
  ASSERT_TRUE(Claim(ours_.get()).ok());
  EXPECT_THAT(Markers(), ElementsAre(id_));
  EXPECT_EQ(*blobs_->Get("jobs/1/aa"), "photo");
}

TEST_F(Installation, ACheckTellsWhatTheStartWouldAndMarksNothing) {
  const DataDir data = *DataDir::Open(dir_ / "data");
  EXPECT_TRUE(CheckBlobs(data).ok()) << "no job store yet, no marker";
  Mark(kOther);
  EXPECT_EQ(Reason(CheckBlobs(data)), "BLOBS_OF_ANOTHER_INSTALLATION");
  EXPECT_FALSE(std::filesystem::exists(data.database()));
  const std::string id = *(*OpenJobStore(places_, data))->InstallationId();
  EXPECT_THAT(std::string(CheckBlobs(data).message()), HasSubstr(id));
  Unmark(kOther);
  EXPECT_TRUE(CheckBlobs(data).ok());
  EXPECT_THAT(Markers(), ElementsAre());
  Mark(id);
  EXPECT_TRUE(CheckBlobs(data).ok());
}

TEST_F(Installation, ACheckKnowsTheInstallationOfAPostgresDatabase) {
  if (!SharedPostgres()) GTEST_SKIP() << "PostgreSQL is not installed here";
  places_.jobs = *SharedPostgres()->NewDatabase();
  const DataDir data = *DataDir::Open(dir_ / "data");
  EXPECT_TRUE(CheckBlobs(data).ok()) << "no tables yet";
  Mark(*(*OpenJobStore(places_, data))->InstallationId());
  EXPECT_TRUE(CheckBlobs(data).ok());
  Mark(kOther);
  EXPECT_EQ(Reason(CheckBlobs(data)), "BLOBS_OF_ANOTHER_INSTALLATION");
}

// As if the check at the start had been skipped, or the marker had changed since.
TEST_F(Installation, OrphansStayWhileTheMarkerIsNotOursAlone) {
  const std::string key = "jobs/0123456789abcdef/" + Sha256::Hex("photo");
  ASSERT_TRUE(blobs_->Put(key, "photo").ok());
  ASSERT_TRUE(Eventually([&] { return *blobs_->QuietSeconds("jobs/0123456789abcdef") >= 1; }));
  const InstallationMarker marker(id_, places_.blobs, blobs_.get());
  UploadLimits limits;
  limits.keep_seconds = 0;
  const DataDir data = *DataDir::Open(dir_ / "data");
  Jobs jobs(ours_.get(), blobs_.get(), data, nullptr, limits);
  Sweeper sweeper(ours_.get(), blobs_.get(), &jobs.uploads(), data, nullptr, &marker);
  const auto stays = [&] { return sweeper.Sweep().ok() && blobs_->Get(key).ok(); };
  EXPECT_EQ(Reason(marker.Check()), "BLOBS_NOT_MARKED");
  EXPECT_TRUE(stays());
  Mark(kOther);
  EXPECT_EQ(Reason(marker.Check()), "BLOBS_OF_ANOTHER_INSTALLATION");
  EXPECT_TRUE(stays());
  Mark(id_);
  EXPECT_TRUE(stays());
  Unmark(kOther);
  EXPECT_TRUE(marker.Check().ok());
  ASSERT_TRUE(sweeper.Sweep().ok());
  EXPECT_EQ(Reason(blobs_->Get(key).status()), "BLOB_NOT_FOUND");
}

// A volume that is not mounted, say, or another --data.
class InstallationFolder : public ::testing::TestWithParam<const char*> {};

INSTANTIATE_TEST_SUITE_P(Blobs, InstallationFolder, ::testing::Values("", "/volume"));

TEST_P(InstallationFolder, WithoutAnyBlobIsNotMarkedWhereTheJobStoreNamesFiles) {
  TempDir dir;
  const DataDir data = *DataDir::Open(dir / "data");
  StorePlaces places;
  if (*GetParam()) places.blobs = absl::StrCat("file://", dir.path(), GetParam());
  const auto store = *OpenJobStore(places, data);
  const auto blobs = *OpenBlobStore(places, data);
  const auto check = [&] { return CheckBlobsAreOurs(places, data, blobs.get()); };
  EXPECT_TRUE(check().ok()) << "the first start";
  JobRecord job;
  job.id = "0123456789abcdef";
  ASSERT_TRUE(store
                  ->Create(job,
                           [](JobTransaction& t) {
                             return t.PutFile({"a.jpg", FileRole::kPhoto, 1, "aa", 4, 3});
                           })
                  .ok());
  EXPECT_EQ(Reason(check()), "BLOBS_NOT_MARKED");
  ASSERT_TRUE(blobs->Put("jobs/lost/lost", "x").ok());
  EXPECT_TRUE(check().ok()) << "as the message says, and as with files from before markers";
  ASSERT_TRUE(ClaimBlobs(places, data, store.get(), blobs.get()).ok());
  ASSERT_TRUE(blobs->RemoveFolder("jobs").ok());
  EXPECT_TRUE(check().ok()) << "marked";
}

// What a server says that does not start, in `folder`/data.
std::string RefusedStart(const std::string& folder, const std::vector<std::string>& flags) {
  std::string command = absl::StrCat(FAKE_SERVER, " --listen 127.0.0.1:0 --data ", folder, "/data");
  for (const std::string& flag : flags) absl::StrAppend(&command, " ", flag);
  const std::string said = absl::StrCat(folder, "/log");
  const int status =
      std::system(absl::StrCat("timeout 60 ", command, " > ", said, " 2>&1").c_str());
  EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 1) << status;
  std::ifstream log(said);
  return {std::istreambuf_iterator<char>(log), {}};
}

TEST(OneJobStore, ServerOfAnotherDataFolderStartsWithoutBlobsOnlyWhereNoFileIsNamed) {
  TempDir dir;
  for (const char* folder : {"a", "b"}) std::filesystem::create_directory(dir / folder);
  const std::vector<std::string> flags = {"--store", absl::StrCat("sqlite://", dir / "jobs.db")};
  ServerProcess a(FAKE_SERVER, dir / "a");
  ASSERT_NO_FATAL_FAILURE(a.Launch(flags));
  const std::string name = a.client().StartedJob({"a", "b", "c"});
  a.client().WaitFor(name, v1::JOB_STATE_SUCCEEDED, 60);
  for (const char* check : {"--check", "--workers=0"}) {
    std::vector<std::string> other = flags;
    other.push_back(check);
    EXPECT_THAT(RefusedStart(dir / "b", other),
                AllOf(HasSubstr("BLOBS_NOT_MARKED"), HasSubstr(dir / "b/data/blobs")));
  }
  EXPECT_EQ(a.End(SIGTERM), 0);
  ASSERT_NO_FATAL_FAILURE(a.Launch(flags));
}

// Servers as they run, each with a data folder of its own.
class InstallationProcess : public Installation {
 protected:
  void SetUp() override {
    Installation::SetUp();
    std::filesystem::create_directory(dir_ / "a");
    std::filesystem::create_directory(dir_ / "b");
  }

  std::vector<std::string> Flags() const {
    return {"--blobs", places_.blobs, "--s3-endpoint", places_.s3_endpoint};
  }

  ServerProcess a_{FAKE_SERVER, dir_ / "a"};
  ServerProcess b_{FAKE_SERVER, dir_ / "b"};
};

TEST_F(InstallationProcess, ServerOfAnotherDatabaseDoesNotStartAndTheFirstOneGoesOn) {
  ASSERT_NO_FATAL_FAILURE(a_.Launch(Flags()));
  const std::string name = a_.client().StartedJob({"a", "b", "c"});
  a_.client().WaitFor(name, v1::JOB_STATE_SUCCEEDED, 60);
  const std::vector<std::string> markers = Markers();
  ASSERT_EQ(markers.size(), 1u);
  EXPECT_THAT(RefusedStart(dir_ / "b", Flags()),
              HasSubstr(absl::StrCat("belongs to another installation, ", markers[0])));
  EXPECT_EQ(a_.End(SIGTERM), 0);
  ASSERT_NO_FATAL_FAILURE(a_.Launch(Flags()));
  v1::Job job;
  EXPECT_TRUE(a_.client().Get(name, &job).ok());
  EXPECT_EQ(Markers(), markers);
}

TEST_F(InstallationProcess, TwoServersOfOneDatabaseStart) {
  if (!SharedPostgres()) GTEST_SKIP() << "PostgreSQL is not installed here";
  std::vector<std::string> flags = Flags();
  flags.insert(flags.end(), {"--store", *SharedPostgres()->NewDatabase()});
  ASSERT_NO_FATAL_FAILURE(a_.Launch(flags));
  ASSERT_NO_FATAL_FAILURE(b_.Launch(flags));
  EXPECT_EQ(Markers().size(), 1u);
}

TEST_F(InstallationProcess, NoServerStartsWhileS3IsAwayAndTheNextStartMarksTheBlobs) {
  const auto server = S3Server::Start();
  if (!server) GTEST_SKIP() << "no S3 server is installed here";
  const S3Options s3 = server->Options();
  places_ = {"", UrlOf(s3), s3.endpoint};
  server->Kill();
  EXPECT_THAT(RefusedStart(dir_ / "b", Flags()), HasSubstr("the blob store is away"));
  server->Run();
  ASSERT_NO_FATAL_FAILURE(b_.Launch(Flags()));
  EXPECT_EQ((*OpenS3BlobStore(s3))->List("installation")->size(), 1u);
  b_.End(SIGTERM);
}

}  // namespace
}  // namespace litags
