// What a client may do with a job beside running it: describe it, clone it, take files out, repeat
// calls, read its log.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "engine/core/error_test_util.h"
#include "engine/core/temp_dir_test_util.h"
#include "server/jobs/codec.h"
#include "server/jobs/jobs.h"
#include "server/jobs/jobs_test_util.h"
#include "server/jobs/leases.h"
#include "server/jobs/sweeper.h"
#include "server/store/digest.h"
#include "server/testing/faulty_blob_store.h"

namespace litags {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

// Calls `on_link` before each link.
class LinkedBlobs : public FaultyBlobStore {
 public:
  using FaultyBlobStore::FaultyBlobStore;
  absl::Status Link(std::string_view from, std::string_view to) override {
    on_link();
    return FaultyBlobStore::Link(from, to);
  }
  std::function<void()> on_link;
};

class DetailsTest : public ::testing::Test {
 protected:
  absl::Status Add(Jobs& jobs, const std::string& id, const std::string& name) {
    return AddFile(jobs, data_, id, name, name);
  }

  std::string UploadedJob(Jobs& jobs) { return litags::UploadedJob(jobs, data_); }

  // That the worker "w" runs.
  Lease TakenJob(Leases& leases) {
    EXPECT_TRUE(jobs_.Start(UploadedJob(jobs_)).ok());
    return **leases.Acquire("w");
  }

  std::vector<std::string> Names(const std::string& id) {
    std::vector<std::string> names;
    const std::vector<FileRecord> files = *jobs_.Files(id);
    for (const FileRecord& file : files) names.push_back(file.name);
    return names;
  }

  std::vector<std::string> LogTexts(const std::string& id) {
    std::vector<std::string> texts;
    const std::vector<LogEntry> log = *jobs_.Log(id, 0, 1000);
    for (const LogEntry& entry : log) texts.push_back(entry.text);
    return texts;
  }

  TempDir dir_;
  DataDir data_ = *DataDir::Open(dir_.path());
  std::unique_ptr<JobStore> store_ = *OpenSqliteJobStore(data_.database());
  std::unique_ptr<BlobStore> blobs_ = *OpenDiskBlobStore(data_.blobs());
  int64_t now_ms_ = 1'000'000;
  Clock clock_ = [this] { return now_ms_; };
  Jobs jobs_{store_.get(), blobs_.get(), data_, clock_};
  Sweeper sweeper_{store_.get(), blobs_.get(), &jobs_.uploads(), data_, clock_};
  Leases leases_{store_.get(), blobs_.get(), {}, clock_};
};

TEST_F(DetailsTest, TitleLabelsPriorityAndRetentionChangeAtAnyTime) {
  const std::string id = UploadedJob(jobs_);
  ASSERT_TRUE(jobs_.Start(id).ok());
  ASSERT_TRUE(jobs_.Cancel(id).ok());
  const int64_t ended_ms = jobs_.Get(id)->end_time_ms;
  now_ms_ += 5000;
  const auto job = jobs_.Update(id, "", [](JobDetails& details) {
    details = {"a name", {{"site", "north"}}, -3, 60};
    return absl::OkStatus();
  });
  ASSERT_TRUE(job.ok()) << job.status();
  EXPECT_EQ(job->display_name, "a name");
  EXPECT_EQ(*LabelsOf(*job), (Labels{{"site", "north"}}));
  EXPECT_EQ(job->priority, -3);
  EXPECT_EQ(job->expire_time_ms, ended_ms + 60'000);
  EXPECT_EQ(jobs_.Get(id)->labels, job->labels);
}

TEST_F(DetailsTest, AChangeOfWhatAnotherChangedIsRefused) {
  const std::string id = UploadedJob(jobs_);
  const std::string etag = EtagOf(*jobs_.Get(id));
  const auto rename = [](JobDetails& details) {
    details.display_name += "x";
    return absl::OkStatus();
  };
  ASSERT_TRUE(jobs_.Update(id, etag, rename).ok());
  const auto late = jobs_.Update(id, etag, rename);
  EXPECT_EQ(late.status().code(), absl::StatusCode::kAborted);
  EXPECT_EQ(Reason(late.status()), "ETAG_MISMATCH");
  EXPECT_EQ(jobs_.Get(id)->display_name, "x");
  EXPECT_TRUE(jobs_.Update(id, EtagOf(*jobs_.Get(id)), rename).ok());
}

TEST_F(DetailsTest, WhatIsWrongChangesNothing) {
  const std::string id = UploadedJob(jobs_);
  const auto change = [&](JobDetails wanted) {
    return Reason(jobs_
                      .Update(id, "",
                              [&](JobDetails& details) {
                                details = wanted;
                                return absl::OkStatus();
                              })
                      .status());
  };
  EXPECT_EQ(change({"", {{"Bad", ""}}, 0, 0}), "LABELS_INVALID");
  EXPECT_EQ(change({"", {}, 101, 0}), "POLICY_OUT_OF_RANGE");
  EXPECT_EQ(change({"", {}, 0, -1}), "POLICY_OUT_OF_RANGE");
  ClientView view;
  view.caps.max_priority = 0;
  const auto higher = jobs_.For(view)->Update(id, "", [](JobDetails& details) {
    details.priority = 1;
    return absl::OkStatus();
  });
  EXPECT_EQ(Reason(higher.status()), "JOB_CAP_EXCEEDED");
}

TEST_F(DetailsTest, ACloneHasTheFilesAndStandsAlone) {
  const std::string id = UploadedJob(jobs_);
  ASSERT_TRUE(jobs_.Start(id).ok());
  NewJob wanted;
  wanted.request_id = "once";
  wanted.options.iterations = 77;
  const auto clone = jobs_.Clone(id, wanted);
  ASSERT_TRUE(clone.ok()) << clone.status();
  EXPECT_NE(clone->id, id);
  EXPECT_EQ(clone->state, JobState::kUploading);
  EXPECT_EQ(clone->photos, 3);
  EXPECT_EQ(Names(clone->id), Names(id));
  EXPECT_EQ(jobs_.Clone(id, wanted)->id, clone->id);
  ASSERT_TRUE(jobs_.Cancel(id).ok());
  ASSERT_TRUE(jobs_.Delete(id).ok());
  ASSERT_TRUE(sweeper_.Sweep().ok());
  EXPECT_EQ(*blobs_->Get(BlobKey(clone->id, Sha256::Hex("a.jpg"))), "a.jpg");
  EXPECT_TRUE(jobs_.Start(clone->id).ok());
}

TEST_F(DetailsTest, ACloneThatIsCancelledGoesOnWhereItWas) {
  LinkedBlobs blobs(blobs_.get());
  Jobs jobs(store_.get(), &blobs, data_, clock_);
  const std::string id = UploadedJob(jobs);
  CancelToken cancel;
  int links = 0;
  blobs.on_link = [&] {
    if (++links == 2) cancel.Cancel();
  };
  NewJob wanted;
  wanted.request_id = "once";
  EXPECT_EQ(jobs.Clone(id, wanted, cancel).status().code(), absl::StatusCode::kCancelled);
  EXPECT_EQ(links, 2);
  const auto clone = jobs.Clone(id, wanted);
  ASSERT_TRUE(clone.ok()) << clone.status();
  EXPECT_EQ(links, 3);
  EXPECT_EQ(Names(clone->id), Names(id));
  EXPECT_EQ(jobs.Clone(id, wanted)->id, clone->id);
  EXPECT_EQ(links, 3);
}

TEST_F(DetailsTest, ACloneThatHasHadAllFilesTakesNoneAgain) {
  const std::string id = UploadedJob(jobs_);
  NewJob wanted;
  wanted.request_id = "once";
  const auto clone = jobs_.Clone(id, wanted);
  ASSERT_TRUE(clone.ok()) << clone.status();
  ASSERT_TRUE(*jobs_.uploads().Remove(clone->id, FileRole::kPhoto, "b.jpg"));
  ASSERT_TRUE(Add(jobs_, id, "d.jpg").ok());
  EXPECT_EQ(jobs_.Clone(id, wanted)->id, clone->id);
  EXPECT_THAT(Names(clone->id), ElementsAre("a.jpg", "c.jpg"));
}

TEST_F(DetailsTest, WhatACallMadeItReturnsAgainAlsoUnderALowerCap) {
  ClientView view;
  NewJob wanted;
  wanted.request_id = "once";
  wanted.request_digest = "00ff";
  wanted.options.iterations = 100;
  const auto made = jobs_.For(view)->Create(wanted);
  ASSERT_TRUE(made.ok()) << made.status();
  view.caps.max_iterations = 50;
  const auto again = jobs_.For(view)->Create(wanted);
  ASSERT_TRUE(again.ok()) << again.status();
  EXPECT_EQ(again->id, made->id);
  wanted.request_digest = "0100";
  EXPECT_EQ(Reason(jobs_.For(view)->Create(wanted).status()), "JOB_CAP_EXCEEDED");
}

// More than go into one change of the store.
TEST_F(DetailsTest, ACloneOfManyFilesHasThemAll) {
  const std::string id = UploadedJob(jobs_);
  const auto add = [](JobTransaction& job) -> absl::Status {
    for (int i = 0; i < 450; ++i) {
      const std::string name = absl::StrCat(i, ".jpg");
      LITAGS_RETURN_IF_ERROR(
          job.PutFile({name, FileRole::kPhoto, 5, Sha256::Hex("a.jpg"), 64, 48}));
    }
    return absl::OkStatus();
  };
  ASSERT_TRUE(store_->Update(id, add).ok());
  const auto clone = jobs_.Clone(id, {});
  ASSERT_TRUE(clone.ok()) << clone.status();
  EXPECT_EQ(Names(clone->id), Names(id));
  EXPECT_EQ(clone->photos, 453);
  EXPECT_EQ(clone->bytes, jobs_.Get(id)->bytes);
}

TEST_F(DetailsTest, ACloneForWhichThereIsNoRoomTakesNoFile) {
  ClientView view;
  view.owner = "me";
  view.max_bytes = 29;
  const auto mine = jobs_.For(view);
  const std::string id = UploadedJob(*mine);
  ASSERT_EQ(mine->Get(id)->bytes, 15);
  NewJob wanted;
  wanted.request_id = "once";
  EXPECT_EQ(Reason(mine->Clone(id, wanted).status()), "BYTE_QUOTA_REACHED");
  EXPECT_THAT(Names(mine->Create(wanted)->id), IsEmpty());
  view.max_bytes = 30;
  EXPECT_TRUE(jobs_.For(view)->Clone(id, wanted).ok());
}

TEST_F(DetailsTest, ACloneThatLacksAMaskTakesItsArchiveAgain) {
  const std::string id = UploadedJob(jobs_);
  const std::string path = data_.tmp() + "/staged";
  std::ofstream(path) << "mask";
  const FileRecord mask{"a.png", FileRole::kMask, 4, Sha256::Hex("mask"), 64, 48};
  const FileRecord archive{"a.zip", FileRole::kArchive, 9, Sha256::Hex("a.zip"), 0, 0};
  ASSERT_TRUE(jobs_.uploads().Add(id, mask, path).ok());
  ASSERT_TRUE(jobs_.uploads().NoteArchive(id, archive).ok());
  NewJob whole, lacking;
  whole.request_id = "whole";
  lacking.request_id = "lacking";
  EXPECT_TRUE(*jobs_.uploads().IsStored(jobs_.Clone(id, whole)->id, archive));

  const auto jobs = jobs_.List(0, "", 10);
  for (const JobRecord& job : *jobs) {
    ASSERT_TRUE(blobs_->Remove(BlobKey(job.id, mask.sha256)).ok());
  }
  EXPECT_EQ(Reason(jobs_.Clone(id, lacking).status()), "CLONED_FILE_GONE");
  const std::string clone = jobs_.Create(lacking)->id;
  EXPECT_THAT(Names(clone), ElementsAre("a.jpg", "b.jpg", "c.jpg"));
  EXPECT_FALSE(*jobs_.uploads().IsStored(clone, archive));
}

TEST_F(DetailsTest, APriorityThatAnAdministratorRaisedLocksNobodyOut) {
  ClientView view;
  view.owner = "me";
  view.caps.max_priority = 0;
  const auto mine = jobs_.For(view);
  const std::string id = UploadedJob(*mine);
  const auto raise = [](JobDetails& details) {
    details.priority = 50;
    return absl::OkStatus();
  };
  ASSERT_TRUE(jobs_.Update(id, "", raise).ok());
  EXPECT_EQ(mine->Start(id)->priority, 50);
  ASSERT_TRUE(mine->Cancel(id).ok());
  const auto more = [](ReconstructOptions& options, JobPolicy&) {
    options.iterations += 100;
    return absl::OkStatus();
  };
  EXPECT_EQ(mine->Resume(id, more)->priority, 50);
  ASSERT_TRUE(mine->Cancel(id).ok());
  const auto higher = [](ReconstructOptions&, JobPolicy& policy) {
    policy.priority = 51;
    return absl::OkStatus();
  };
  EXPECT_EQ(Reason(mine->Resume(id, higher).status()), "JOB_CAP_EXCEEDED");

  NewJob wanted;
  wanted.policy = *PolicyOf(*mine->Get(id));
  const auto clone = mine->Clone(id, wanted);
  ASSERT_TRUE(clone.ok()) << clone.status();
  EXPECT_EQ(clone->priority, 0);
  wanted.policy.priority = 20;
  EXPECT_EQ(Reason(mine->Clone(id, wanted).status()), "JOB_CAP_EXCEEDED");
}

TEST_F(DetailsTest, ALowerCapOfRunTimeLocksNobodyOut) {
  ClientView view;
  view.owner = "me";
  view.caps.max_run_seconds = 1000;
  const auto before = jobs_.For(view);
  const auto policy_of = [&](const absl::StatusOr<JobRecord>& job) {
    EXPECT_TRUE(job.ok()) << job.status();
    return job.ok() ? *PolicyOf(*job) : JobPolicy();
  };
  NewJob wanted;
  wanted.policy.max_run_seconds = 900;
  const std::string silent = UploadedJob(*before), long_one = before->Create(wanted)->id;
  for (const char* name : {"a.jpg", "b.jpg", "c.jpg"})
    ASSERT_TRUE(Add(*before, long_one, name).ok());
  EXPECT_EQ(policy_of(before->Start(silent)).max_run_seconds, 1000);
  EXPECT_EQ(policy_of(before->Start(long_one)).max_run_seconds, 900);
  view.caps.max_run_seconds = 60;
  const auto now = jobs_.For(view);
  for (const std::string& id : {silent, long_one}) {
    ASSERT_TRUE(now->Cancel(id).ok());
    NewJob same;
    same.policy = PolicyOf(*now->Get(id))->WithoutCap();
    const auto clone = now->Clone(id, same);
    EXPECT_EQ(policy_of(clone).max_run_seconds, id == silent ? 0 : 60);
    EXPECT_EQ(policy_of(now->Start(clone->id)).max_run_seconds, 60);
    EXPECT_EQ(policy_of(now->Resume(id)).max_run_seconds, 60);
    ASSERT_TRUE(now->Cancel(id).ok());
    const auto longer = [](ReconstructOptions&, JobPolicy& policy) {
      policy.max_run_seconds = 61;
      return absl::OkStatus();
    };
    EXPECT_EQ(Reason(now->Resume(id, longer).status()), "JOB_CAP_EXCEEDED");
  }
  // The cap was no wish of the job's.
  view.caps.max_run_seconds = 500;
  EXPECT_EQ(policy_of(jobs_.For(view)->Resume(silent)).max_run_seconds, 500);
}

TEST_F(DetailsTest, NobodyClonesAnotherClientsJob) {
  const auto mine = jobs_.For({.owner = "me"}), other = jobs_.For({.owner = "other"});
  const std::string id = UploadedJob(*mine);
  EXPECT_EQ(Reason(other->Clone(id, {}).status()), "JOB_NOT_FOUND");
  const auto admin = jobs_.For({.owner = "admin", .sees_all = true});
  EXPECT_EQ(Reason(admin->Clone(id, {}).status()), "NOT_YOUR_JOB");
  EXPECT_EQ(jobs_.UsageOf("admin")->jobs, 0);
  EXPECT_TRUE(mine->Clone(id, {}).ok());
}

TEST_F(DetailsTest, AFileIsTakenOutBeforeTheStart) {
  const std::string id = UploadedJob(jobs_);
  EXPECT_TRUE(*jobs_.uploads().Remove(id, FileRole::kPhoto, "b.jpg"));
  EXPECT_FALSE(*jobs_.uploads().Remove(id, FileRole::kPhoto, "b.jpg"));
  EXPECT_FALSE(*jobs_.uploads().Remove(id, FileRole::kMask, "a.jpg"));
  EXPECT_THAT(Names(id), ElementsAre("a.jpg", "c.jpg"));
  EXPECT_EQ(jobs_.Get(id)->photos, 2);
  EXPECT_EQ(Reason(jobs_.Start(id).status()), "TOO_FEW_PHOTOS");
  ASSERT_TRUE(Add(jobs_, id, "b.jpg").ok());
  ASSERT_TRUE(jobs_.Start(id).ok());
  EXPECT_EQ(Reason(jobs_.uploads().Remove(id, FileRole::kPhoto, "b.jpg").status()),
            "JOB_NOT_UPLOADING");
  EXPECT_EQ(jobs_.Get(id)->photos, 3);
}

TEST_F(DetailsTest, BytesOfRemovedFilesCountUntilTheyAreSwept) {
  const std::string id = UploadedJob(jobs_);
  const int64_t before = jobs_.UsageOf("")->bytes;
  ASSERT_TRUE(*jobs_.uploads().Remove(id, FileRole::kPhoto, "b.jpg"));
  EXPECT_EQ(jobs_.UsageOf("")->bytes, before);
  ASSERT_TRUE(jobs_.Cancel(id).ok());
  ASSERT_TRUE(sweeper_.Sweep().ok());
  EXPECT_FALSE(blobs_->Get(BlobKey(id, Sha256::Hex("b.jpg"))).ok());
  EXPECT_TRUE(blobs_->Get(BlobKey(id, Sha256::Hex("a.jpg"))).ok());
}

TEST_F(DetailsTest, StartAndResumeWithTheSameRequestIdChangeNothing) {
  const std::string id = UploadedJob(jobs_);
  ASSERT_TRUE(jobs_.Start(id, "s1").ok());
  const int64_t events = jobs_.Get(id)->last_event;
  ASSERT_TRUE(jobs_.Start(id, "s1").ok());
  EXPECT_EQ(jobs_.Get(id)->last_event, events);
  EXPECT_EQ(Reason(jobs_.Start(id, "s2").status()), "JOB_NOT_UPLOADING");
  EXPECT_EQ(Reason(jobs_.Start(id).status()), "JOB_NOT_UPLOADING");

  ASSERT_TRUE(jobs_.Cancel(id).ok());
  ASSERT_TRUE(jobs_.Resume(id, nullptr, "r1").ok());
  ASSERT_TRUE(jobs_.Resume(id, nullptr, "r1").ok());
  EXPECT_EQ(Reason(jobs_.Resume(id, nullptr, "r2").status()), "JOB_NOT_RESUMABLE");
  // A repeated StartJob of long ago queues nothing that was cancelled since.
  ASSERT_TRUE(jobs_.Cancel(id).ok());
  EXPECT_EQ(Reason(jobs_.Start(id, "s1").status()), "JOB_NOT_UPLOADING");
}

TEST_F(DetailsTest, ALogTellsWhatHappened) {
  const std::string id = UploadedJob(jobs_);
  ASSERT_TRUE(jobs_.Start(id).ok());
  const auto lease = *leases_.Acquire("w");
  ASSERT_TRUE(leases_.AddLog(*lease, {{0, 7, LogSeverity::kInfo, "loading"}}).ok());
  ASSERT_TRUE(leases_.Fail(*lease, absl::InternalError("it broke")).ok());
  EXPECT_THAT(LogTexts(id), ElementsAre(HasSubstr("UPLOADING"), "QUEUED: started",
                                        HasSubstr("RUNNING"), "loading", "FAILED: it broke"));
  const std::vector<LogEntry> log = *jobs_.Log(id, 0, 1000);
  EXPECT_EQ(log.back().severity, LogSeverity::kError);
  EXPECT_EQ(log.back().number, jobs_.Get(id)->last_log_entry);
  EXPECT_EQ(log[3].time_ms, 7);
  EXPECT_EQ(jobs_.Log(id, 4, 1000)->size(), 1u);
  EXPECT_EQ(leases_.AddLog(*lease, {{0, 9, LogSeverity::kInfo, "late"}}).code(),
            absl::StatusCode::kAborted);
}

TEST_F(DetailsTest, ALogHasAnEnd) {
  Leases leases(store_.get(), blobs_.get(), {.max_log_bytes = 1000}, clock_);
  const Lease lease = TakenJob(leases);
  const std::string& id = lease.job.id;
  const std::vector<LogEntry> lines(5, {0, 7, LogSeverity::kInfo, std::string(100, 'x')});
  for (int i = 0; i < 20; ++i) ASSERT_TRUE(leases.AddLog(lease, lines).ok());
  EXPECT_LE(jobs_.Get(id)->log_bytes, 1000);
  const std::vector<std::string> texts = LogTexts(id);
  EXPECT_LT(texts.size(), 15u);
  EXPECT_THAT(texts.back(), HasSubstr("full"));
  // What ends the job is told nevertheless.
  ASSERT_TRUE(leases.Fail(lease, absl::InternalError("it broke")).ok());
  EXPECT_EQ(LogTexts(id).back(), "FAILED: it broke");
}

TEST_F(DetailsTest, NotesOfAFinishedRunLeaveTheLogItsEnd) {
  Leases leases(store_.get(), blobs_.get(), {.max_log_bytes = 1000}, clock_);
  const Lease lease = TakenJob(leases);
  const std::string& id = lease.job.id;
  ReconstructReport report;
  report.notes.assign(100, std::string(100, 'x'));
  ASSERT_TRUE(leases.Succeed(lease, report, {{kSceneFile, {"1/aa", 5}}}).ok());
  EXPECT_LT(jobs_.Get(id)->log_bytes, 1100);
  EXPECT_THAT(LogTexts(id).back(), HasSubstr("SUCCEEDED"));
}

TEST_F(DetailsTest, CancelAndResumeInALoopComesToAnEnd) {
  const std::string id = UploadedJob(jobs_);
  ASSERT_TRUE(jobs_.Start(id).ok());
  absl::Status refused;
  for (int i = 0; i < 1000 && refused.ok(); ++i) {
    ASSERT_TRUE(jobs_.Cancel(id).ok());
    refused = jobs_.Resume(id).status();
  }
  EXPECT_EQ(Reason(refused), "JOB_WITHOUT_PROGRESS");
  EXPECT_EQ(jobs_.Get(id)->state, JobState::kCancelled);
  EXPECT_LT(jobs_.Get(id)->last_event, 1010);
  EXPECT_TRUE(jobs_.Clone(id, {}).ok());
}

TEST_F(DetailsTest, ProgressLetsAJobBeResumedAgain) {
  const std::string id = UploadedJob(jobs_);
  ASSERT_TRUE(jobs_.Start(id).ok());
  for (int i = 0; i < 600; ++i) {
    if (i == 400) {
      const auto lease = *leases_.Acquire("w");
      ASSERT_TRUE(leases_.AddProgress(*lease, {}).ok());
      ASSERT_TRUE(leases_.GiveBack(*lease, 0).ok());
    }
    ASSERT_TRUE(jobs_.Cancel(id).ok());
    ASSERT_TRUE(jobs_.Resume(id).ok()) << i;
  }
}

TEST_F(DetailsTest, NoChangeOfStateIsToldInALogBeyondItsLastBytes) {
  const std::string id = UploadedJob(jobs_);
  ASSERT_TRUE(jobs_.Start(id).ok());
  const auto fill = [](JobTransaction& job) {
    job.job.log_bytes = kMaxJobLogBytesWithStates - 1;
    return absl::OkStatus();
  };
  ASSERT_TRUE(store_->Update(id, fill).ok());
  ASSERT_TRUE(jobs_.Cancel(id).ok());
  EXPECT_THAT(LogTexts(id).back(), HasSubstr("CANCELLED"));
  ASSERT_TRUE(jobs_.Resume(id).ok());
  EXPECT_THAT(LogTexts(id).back(), HasSubstr("CANCELLED"));
}

}  // namespace
}  // namespace litags
