#include "server/jobs/jobs.h"
#include "server/jobs/overview.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>

#include "absl/strings/str_cat.h"
#include "engine/core/error_test_util.h"
#include "server/jobs/codec.h"
#include "server/jobs/jobs_test_util.h"
#include "server/jobs/placement.h"
#include "server/reader/file_findings.h"
#include "server/store/digest.h"

namespace litags {
namespace {

using ::testing::HasSubstr;

TEST_F(JobsTest, JobGoesFromUploadToSuccessWithAGaplessHistory) {
  const std::string id = StartedJob();
  const auto lease = leases_.Acquire("w1");
  ASSERT_TRUE(lease.ok() && lease->has_value());
  Progress progress;
  progress.iteration = 7;
  progress.preview_png = {1, 2, 3};
  ASSERT_TRUE(leases_.AddProgress(**lease, progress).ok());
  const KeptFiles first{{kSceneFile, {"3/a", 10}}}, last{{kSceneFile, {"3/b", 11}}};
  ASSERT_TRUE(leases_.Keep(**lease, first, 7).ok());
  ReconstructReport report;
  report.iterations = 9;
  report.ssim_holdout = 0.75;
  ASSERT_TRUE(leases_.Succeed(**lease, report, last).ok());

  EXPECT_EQ(History(id), "UPLOADING QUEUED RUNNING SUCCEEDED ");
  const JobRecord job = *jobs_.Get(id);
  EXPECT_EQ(job.snapshot_iteration, 9);
  EXPECT_EQ(**Jobs::SceneOf(job), last.at(kSceneFile));
  EXPECT_EQ(Decode<ReconstructReport>(job.report)->iterations, 9);
  EXPECT_EQ(Decode<ReconstructReport>(job.report)->ssim_holdout, 0.75);
  const auto stored = Decode<ProgressRecord>(job.progress);
  EXPECT_TRUE(std::isnan(stored->progress.psnr_holdout));
  EXPECT_EQ(*jobs_.Preview(id, stored->preview), std::string("\1\2\3"));
  EXPECT_GT(job.end_time_ms, 0);
}

TEST_F(JobsTest, RequestIdGivesTheSameJobUnlessTheContentDiffers) {
  const std::string id = jobs_.Create({"r", "title", "", {}, {}})->id;
  EXPECT_EQ(jobs_.Create({"r", "title", "", {}, {}})->id, id);
  ReconstructOptions other;
  other.iterations = 5;
  const auto refused = jobs_.Create({"r", "title", "", other, {}});
  EXPECT_EQ(refused.status().code(), absl::StatusCode::kAlreadyExists);
  EXPECT_EQ(Reason(refused.status()), "REQUEST_ID_REUSED");
  const auto other_files = jobs_.Create({"r", "title", "abcd", {}, {}});
  EXPECT_EQ(Reason(other_files.status()), "REQUEST_ID_REUSED");
  EXPECT_THAT(std::string(other_files.status().message()), HasSubstr("other files"));
}

TEST_F(JobsTest, RequestIdStandsForTheRequestWhateverBecameOfTheJob) {
  const NewJob first = {"r", "title", "", {}, {}, "digest"};
  const std::string id = jobs_.Create(first)->id;
  ASSERT_TRUE(Add(id, "a.jpg").ok());
  ASSERT_TRUE(Add(id, "b.jpg").ok());
  ASSERT_TRUE(Add(id, "c.jpg").ok());
  ASSERT_TRUE(jobs_.Start(id).ok());
  ASSERT_TRUE(jobs_.Cancel(id).ok());
  const auto more = [](ReconstructOptions& options, JobPolicy&) {
    options.iterations += 10;
    return absl::OkStatus();
  };
  ASSERT_TRUE(jobs_.Resume(id, more).ok());
  const auto again = jobs_.Create(first);
  ASSERT_TRUE(again.ok()) << again.status();
  EXPECT_EQ(again->id, id);
  // What the job is now is not what was asked for.
  NewJob other = {"r", "title", "", {}, {}, "other digest"};
  other.options.iterations += 10;
  EXPECT_EQ(Reason(jobs_.Create(other).status()), "REQUEST_ID_REUSED");
}

TEST_F(JobsTest, TwoPhotosAreTooFew) {
  const std::string id = jobs_.Create({})->id;
  EXPECT_EQ(Reason(jobs_.Start(id).status()), "TOO_FEW_PHOTOS");
  ASSERT_TRUE(Add(id, "a.jpg").ok());
  ASSERT_TRUE(Add(id, "b.jpg").ok());
  ASSERT_TRUE(Add(id, "a.png", 0, 0, FileRole::kDepth).ok());
  const absl::Status status = jobs_.Start(id).status();
  EXPECT_EQ(Reason(status), "TOO_FEW_PHOTOS");
  EXPECT_THAT(std::string(status.message()), HasSubstr("2 photos; a scene needs at least 3"));
  EXPECT_EQ(State(id), JobState::kUploading);
}

TEST_F(JobsTest, AColmapModelNeedsCamerasAndImagesOfOneForm) {
  const std::string id = jobs_.Create({})->id;
  for (const char* name : {"a.jpg", "b.jpg", "c.jpg"}) ASSERT_TRUE(Add(id, name).ok());
  for (const char* name : {"cameras.txt", "points3D.txt", "images.bin"}) {
    ASSERT_TRUE(Add(id, name, 0, 0, FileRole::kColmap).ok());
    const absl::Status status = jobs_.Start(id).status();
    EXPECT_EQ(Reason(status), "COLMAP_INCOMPLETE");
    EXPECT_THAT(std::string(status.message()), HasSubstr(name));
  }
  ASSERT_TRUE(Add(id, "cameras.bin", 0, 0, FileRole::kColmap).ok());
  EXPECT_TRUE(jobs_.Start(id).ok());  // points3D.bin is not needed
}

TEST_F(JobsTest, AJobWaitsForAWorkerThatHasTheMemoryOfItsPhotos) {
  const std::string id = jobs_.Create({})->id;
  for (int i = 0; i < 3; ++i) {
    const std::string name = absl::StrCat(i, ".jpg"), path = data_.tmp() + "/staged";
    std::ofstream(path) << name;
    PhotoFindings found;
    found.structure = 1;
    found.pixels = absl::StrCat("000000000000000", i);
    ASSERT_TRUE(jobs_.uploads()
                    .Add(id,
                         {name, FileRole::kPhoto, 5, Sha256::Hex(name), 12000, 9000, Encode(found)},
                         path)
                    .ok());
  }
  const auto started = jobs_.Start(id);
  ASSERT_TRUE(started.ok()) << started.status();
  constexpr int64_t kGiB = int64_t{1} << 30;
  EXPECT_THAT(WaitsFor(*started, {Resources{8, kGiB, {}}}), HasSubstr("smaller max_image_side"));
  EXPECT_FALSE(leases_.Acquire("small", {8, kGiB, {}})->has_value());
  EXPECT_TRUE(leases_.Acquire("large", {8, 64 * kGiB, {}})->has_value());
}

TEST_F(JobsTest, PhotosMayHaveSeveralSizes) {
  const std::string id = jobs_.Create({})->id;
  ASSERT_TRUE(Add(id, "a.jpg", 64, 48).ok());
  ASSERT_TRUE(Add(id, "b.jpg", 48, 64).ok());
  ASSERT_TRUE(Add(id, "c.jpg", 48, 64).ok());
  EXPECT_TRUE(jobs_.Start(id).ok());
}

TEST_F(JobsTest, CancelEndsWaitingJobsAtOnceAndRunningOnesThroughTheirWorker) {
  const std::string uploading = jobs_.Create({})->id;
  EXPECT_EQ(jobs_.Cancel(uploading)->state, JobState::kCancelled);

  const std::string id = StartedJob();
  const Lease lease = **leases_.Acquire("w1");
  const auto asked = jobs_.Cancel(id);
  EXPECT_EQ(asked->state, JobState::kRunning);
  EXPECT_TRUE(asked->cancel_requested);
  EXPECT_TRUE(*leases_.CancelRequested(lease));
  EXPECT_TRUE(*leases_.Heartbeat(lease, 0));
  ASSERT_TRUE(leases_.Stopped(lease).ok());
  EXPECT_EQ(State(id), JobState::kCancelled);
  EXPECT_FALSE(jobs_.Get(id)->cancel_requested);
  EXPECT_TRUE(jobs_.Cancel(id).ok());  // no-op

  ASSERT_TRUE(jobs_.Resume(id).ok());
  EXPECT_EQ(State(id), JobState::kQueued);
  EXPECT_EQ(jobs_.Get(id)->end_time_ms, 0);
  EXPECT_EQ(History(id), "UPLOADING QUEUED RUNNING CANCELLED QUEUED ");
}

TEST_F(JobsTest, ResumeChangesWhatItIsToldAndNothingOfAJobThatItRefuses) {
  JobPolicy policy;
  policy.retention_seconds = 60;
  policy.max_run_seconds = 50;
  const std::string id = StartedJob(policy);
  ReconstructReport report;
  report.iterations = ReconstructOptions().iterations;
  const KeptFiles kept_files = {{kSceneFile, {"1/aa", 5}}, {"checkpoint.litags", {"1/bb", 15}}};
  ASSERT_TRUE(leases_.Succeed(**leases_.Acquire("w1"), report, kept_files).ok());
  EXPECT_EQ(jobs_.Get(id)->expire_time_ms, now_ms_ + 60'000);
  const JobRecord before = *jobs_.Get(id);

  const auto refused = jobs_.Resume(id, [](ReconstructOptions& o, JobPolicy& p) {
    p.priority = 9;
    o.iterations += 100;
    o.sh_degree = 1;
    return absl::OkStatus();
  });
  EXPECT_EQ(Reason(refused.status()), "OPTION_NOT_RESUMABLE");
  EXPECT_EQ(jobs_.Get(id)->options, before.options);
  EXPECT_EQ(jobs_.Get(id)->policy, before.policy);
  EXPECT_EQ(jobs_.Get(id)->priority, 0);
  EXPECT_EQ(jobs_.Get(id)->last_event, before.last_event);

  const auto resumed = jobs_.Resume(id, [](ReconstructOptions& o, JobPolicy& p) {
    p.priority = 9;
    p.max_run_seconds = 70;
    o.iterations += 100;
    return absl::OkStatus();
  });
  ASSERT_TRUE(resumed.ok()) << resumed.status();
  EXPECT_EQ(resumed->state, JobState::kQueued);
  EXPECT_EQ(resumed->priority, 9);
  EXPECT_EQ(resumed->expire_time_ms, 0);
  KeptFiles kept_on = kept_files;
  kept_on[kFinishedScene] = kept_files.at(kSceneFile);  // until a better one is finished
  EXPECT_EQ(*Decode<KeptFiles>(resumed->kept), kept_on);
  const auto options = Decode<ReconstructOptions>(resumed->options);
  EXPECT_EQ(options->iterations, ReconstructOptions().iterations + 100);
  EXPECT_EQ(options->schedule_iterations, ReconstructOptions().iterations);
  const auto kept = Decode<JobPolicy>(resumed->policy);
  EXPECT_EQ(kept->max_run_seconds, 70);
  EXPECT_EQ(kept->retention_seconds, 60);
  EXPECT_EQ(History(id), "UPLOADING QUEUED RUNNING SUCCEEDED QUEUED ");
}

TEST_F(JobsTest, HigherPrioritiesLeaveTheQueueFirstAndEqualOnesInOrder) {
  std::vector<std::string> ids;
  for (const int priority : {0, -5, 7, 0, 7, 0}) {
    now_ms_ += 1;
    JobPolicy policy;
    policy.priority = priority;
    ids.push_back(StartedJob(policy));
  }
  for (const int expected : {2, 4, 0, 3, 5, 1}) {
    const auto lease = leases_.Acquire("w");
    ASSERT_TRUE(lease.ok() && lease->has_value());
    EXPECT_EQ((*lease)->job.id, ids[expected]);
  }
}

TEST_F(JobsTest, OverviewHasTheLongestWaitAndTheRateOfWhatRuns) {
  EXPECT_EQ(OverviewOf(*store_, now_ms_)->by_state.at(JobState::kQueued), 0);
  EXPECT_EQ(OverviewOf(*store_, now_ms_)->queue_age_seconds, 0);
  for (int i = 0; i < 4; ++i) StartedJob();
  for (const char* worker : {"w1", "w2"}) {
    const Lease lease = **leases_.Acquire(worker);
    EXPECT_EQ(OverviewOf(*store_, now_ms_)->iterations_per_second,
              worker == std::string("w1") ? 0 : 12.5);
    Progress progress;
    progress.iterations_per_second = 12.5;
    ASSERT_TRUE(leases_.AddProgress(lease, progress).ok());
  }
  now_ms_ += 1500;
  const JobsOverview overview = *OverviewOf(*store_, now_ms_);
  EXPECT_EQ(overview.by_state.at(JobState::kQueued), 2);
  EXPECT_EQ(overview.by_state.at(JobState::kRunning), 2);
  EXPECT_EQ(overview.queue_age_seconds, 1.5);
  EXPECT_EQ(overview.iterations_per_second, 25);
  now_ms_ -= 3'600'000;  // a clock that is set back
  EXPECT_EQ(OverviewOf(*store_, now_ms_)->queue_age_seconds, 0);
}

TEST_F(JobsTest, TimeWithWorkersIsSummedUpUntilTheJobIsResumed) {
  const std::string id = StartedJob();
  for (int i = 1; i <= 2; ++i) {
    const Lease lease = **leases_.Acquire("w");
    ASSERT_TRUE(leases_.Heartbeat(lease, 5000).ok());
    ASSERT_TRUE(leases_.WorkerDied("w", "gone").ok());
    now_ms_ += 60'000;  // in the queue
    EXPECT_EQ(jobs_.Get(id)->run_ms, i * 5000);
  }
  const Lease lease = **leases_.Acquire("w");
  EXPECT_EQ(lease.job.run_ms, 10'000);
  ASSERT_TRUE(leases_.Fail(lease, absl::InternalError("x")).ok());
  EXPECT_EQ(jobs_.Get(id)->run_ms, 10'000);
  ASSERT_TRUE(jobs_.Resume(id).ok());
  EXPECT_EQ(jobs_.Get(id)->run_ms, 0);
}

TEST_F(JobsTest, JobsAreKeptAfterTheirEndAsLongAsTheirPolicySays) {
  JobPolicy policy;
  policy.retention_seconds = 60;
  const std::string brief = StartedJob(policy), lasting = StartedJob();
  for (int i = 0; i < 2; ++i) {
    ASSERT_TRUE(leases_.Fail(**leases_.Acquire("w"), absl::InternalError("x")).ok());
  }
  EXPECT_EQ(jobs_.Get(brief)->expire_time_ms, now_ms_ + 60'000);
  EXPECT_EQ(jobs_.Get(lasting)->expire_time_ms, 0);
  ASSERT_TRUE(jobs_.Resume(brief).ok());  // lives again
  now_ms_ += 100'000;
  EXPECT_TRUE(sweeper_.Sweep()->empty());
  ASSERT_TRUE(jobs_.Cancel(brief).ok());
  now_ms_ += 60'000;
  EXPECT_THAT(*sweeper_.Sweep(), ::testing::ElementsAre(brief));
  EXPECT_FALSE(std::filesystem::exists(data_.blobs() + "/jobs/" + brief));
  EXPECT_TRUE(jobs_.Get(lasting).ok());
}

TEST_F(JobsTest, FailureKeepsCodeMessageAndDetail) {
  const std::string id = StartedJob();
  const Lease lease = **leases_.Acquire("w");
  ASSERT_TRUE(leases_
                  .Fail(lease, MakeError(absl::StatusCode::kFailedPrecondition, "SFM_TOO_FEW_VIEWS",
                                         "images", "6 of 40 views; bytes \xff\xfe"))
                  .ok());
  const auto error = Decode<JobError>(jobs_.Get(id)->error);
  ASSERT_TRUE(error.ok()) << error.status();
  EXPECT_EQ(error->code, absl::StatusCode::kFailedPrecondition);
  EXPECT_EQ(error->detail.reason, "SFM_TOO_FEW_VIEWS");
  EXPECT_EQ(error->detail.field, "images");
  EXPECT_THAT(error->message, HasSubstr("6 of 40 views"));
}

TEST_F(JobsTest, DeleteRemovesEverythingAndRefusesARunningJob) {
  const std::string id = StartedJob();
  const Lease lease = **leases_.Acquire("w");
  EXPECT_EQ(Reason(jobs_.Delete(id)), "JOB_RUNNING");
  ASSERT_TRUE(leases_.Fail(lease, absl::InternalError("x")).ok());
  ASSERT_TRUE(jobs_.Delete(id).ok());
  EXPECT_EQ(Reason(jobs_.Get(id).status()), "JOB_NOT_FOUND");
  EXPECT_FALSE(std::filesystem::exists(data_.blobs() + "/jobs/" + id));
  EXPECT_EQ(Reason(leases_.Heartbeat(lease, 0).status()), "LEASE_LOST");
}

TEST_F(JobsTest, BlobsThatNoRowNamesAreRemovedOnceTheJobHasEnded) {
  const std::string id = StartedJob();
  const Lease lost = **leases_.Acquire("w1");
  Progress progress;
  progress.preview_png = {1, 2, 3};
  ASSERT_TRUE(leases_.AddProgress(lost, progress).ok());
  const auto put = [&](const Lease& lease, char digit) {
    const std::string blob = LeaseBlob(lease.job.last_event, std::string(64, digit));
    EXPECT_TRUE(blobs_->Put(BlobKey(id, blob), "bytes").ok());
    return blob;
  };
  const std::string named = put(lost, 'a'), unnamed = put(lost, 'b');
  ASSERT_TRUE(leases_.Keep(lost, {{kSceneFile, {named, 5}}}, 1).ok());
  ASSERT_TRUE(leases_.WorkerDied("w1", "killed").ok());
  const Lease held = **leases_.Acquire("w2");
  const std::string late = put(held, 'c');
  ASSERT_TRUE(sweeper_.Sweep().ok());
  EXPECT_TRUE(blobs_->Get(BlobKey(id, late)).ok()) << "a running job may be about to name it";
  ASSERT_TRUE(leases_.Fail(held, absl::InternalError("x")).ok());
  ASSERT_TRUE(sweeper_.Sweep().ok());
  for (const std::string& gone : {unnamed, late}) {
    EXPECT_EQ(Reason(blobs_->Get(BlobKey(id, gone)).status()), "BLOB_NOT_FOUND");
  }
  EXPECT_TRUE(blobs_->Get(BlobKey(id, named)).ok());
  const auto shown = Decode<ProgressRecord>(jobs_.Get(id)->progress);
  EXPECT_TRUE(jobs_.Preview(id, shown->preview).ok());
  EXPECT_TRUE(blobs_->Get(BlobKey(id, Sha256::Hex("a.jpg"))).ok()) << "a photo";
  EXPECT_TRUE(store_->JobsWithUnreferencedBlobs(10)->empty());
  // A worker that wakes up now says so itself.
  put(lost, 'd');
  EXPECT_EQ(Reason(leases_.Keep(lost, {}, {})), "LEASE_LOST");
  ASSERT_TRUE(leases_.NoteUnreferencedBlobs(lost).ok());
  EXPECT_THAT(*store_->JobsWithUnreferencedBlobs(10), ::testing::ElementsAre(id));
  ASSERT_TRUE(sweeper_.Sweep().ok());
  EXPECT_EQ(blobs_->List("jobs/" + id + "/" + std::to_string(lost.job.last_event))->size(), 2u);
}

TEST_F(JobsTest, WhatARunLeavesIsCountedAndPreviewsAreBounded) {
  LeaseOptions options;
  options.max_preview_bytes = 100;
  Leases leases(store_.get(), blobs_.get(), options, clock_);
  const std::string id = StartedJob();
  const int64_t files = store_->UsageOf("")->bytes;
  const Lease lease = **leases.Acquire("w1");
  Progress progress;
  for (int i = 0; i < 3; ++i) {
    progress.iteration = i;
    progress.preview_png.assign(60, static_cast<uint8_t>(i));
    ASSERT_TRUE(leases.AddProgress(lease, progress).ok());
  }
  std::vector<bool> has_preview;
  const std::vector<EventRecord> events = *jobs_.Events(id, 0, 1000);
  for (const EventRecord& event : events) {
    if (event.kind != EventKind::kProgress) continue;
    has_preview.push_back(!Decode<ProgressRecord>(event.payload)->preview.empty());
  }
  EXPECT_EQ(has_preview, (std::vector<bool>{true, false, false}));
  ASSERT_TRUE(leases.Keep(lease, {{"checkpoint.litags", {"1/aa", 1000}}}, 1).ok());
  ASSERT_TRUE(leases.Keep(lease, {{"checkpoint.litags", {"1/bb", 2000}}}, 2).ok());
  EXPECT_EQ(store_->UsageOf("")->bytes, files + 60 + 2000);
  const KeptFiles kept = {{"checkpoint.litags", {"1/bb", 2000}}, {kSceneFile, {"1/cc", 500}}};
  ASSERT_TRUE(leases.Succeed(lease, {}, kept).ok());
  EXPECT_EQ(store_->UsageOf("")->bytes, files + 60 + 2500);
}

}  // namespace
}  // namespace litags
