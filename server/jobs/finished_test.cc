// What becomes of a finished scene whose job is trained further, and of a job that failed for its
// files.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "engine/core/error_test_util.h"
#include "engine/core/temp_dir_test_util.h"
#include "server/jobs/codec.h"
#include "server/jobs/jobs.h"
#include "server/jobs/jobs_test_util.h"
#include "server/jobs/leases.h"
#include "server/jobs/sweeper.h"
#include "server/store/digest.h"

namespace litags {
namespace {

using ::testing::HasSubstr;

class FinishedTest : public ::testing::Test {
 protected:
  absl::Status Add(const std::string& id, const std::string& name, const std::string& bytes,
                   FileRole role = FileRole::kPhoto) {
    return AddFile(jobs_, data_, id, name, bytes, role);
  }

  std::string UploadedJob(const ReconstructOptions& options = {}) {
    NewJob wanted;
    wanted.options = options;
    return litags::UploadedJob(jobs_, data_, wanted);
  }

  // A blob of the lease, as the worker stores it.
  KeptFile Scene(const Lease& lease, const std::string& bytes) {
    const KeptFile file{LeaseBlob(lease.job.last_event, Sha256::Hex(bytes)),
                        static_cast<int64_t>(bytes.size())};
    EXPECT_TRUE(blobs_->Put(BlobKey(lease.job.id, file.blob), bytes).ok());
    return file;
  }

  Lease Acquired() { return **leases_.Acquire("w"); }

  // A job of 100 iterations that is done.
  std::string SucceededJob() {
    ReconstructOptions options;
    options.iterations = 100;
    const std::string id = UploadedJob(options);
    EXPECT_TRUE(jobs_.Start(id).ok());
    const Lease lease = Acquired();
    ReconstructReport report;
    report.iterations = 100;
    finished_ = Scene(lease, "finished");
    EXPECT_TRUE(leases_.Succeed(lease, report, {{kSceneFile, finished_}}).ok());
    return id;
  }

  void Extend(const std::string& id) {
    const auto more = [](ReconstructOptions& options, JobPolicy&) {
      options.iterations = 200;
      return absl::OkStatus();
    };
    ASSERT_TRUE(jobs_.Resume(id, more).ok());
  }

  // A worker takes the job, and brings a snapshot of its 150th iteration.
  Lease HalfWay(const std::string& id) {
    const Lease lease = Acquired();
    EXPECT_EQ(lease.job.id, id);
    KeptFiles kept = *Decode<KeptFiles>(lease.job.kept);
    half_way_ = kept[kSceneFile] = Scene(lease, "half way");
    EXPECT_TRUE(leases_.Keep(lease, kept, 150).ok());
    EXPECT_EQ(**Jobs::SceneOf(*jobs_.Get(id)), half_way_);
    return lease;
  }

  void ExpectFinishedSceneIsThere(const std::string& id, JobState state) {
    const JobRecord job = *jobs_.Get(id);
    EXPECT_EQ(job.state, state);
    EXPECT_EQ(**Jobs::SceneOf(job), finished_);
    EXPECT_EQ(job.kept_bytes, finished_.bytes) << "counted once, whatever its names";
    EXPECT_EQ(job.snapshot_iteration, 100);
    EXPECT_EQ(Decode<ReconstructReport>(job.report)->iterations, 100);
    const auto events = *jobs_.Events(id, job.last_event - 1, 9);
    EXPECT_THAT(Decode<StateChange>(events.back().payload)->message,
                HasSubstr("finished scene of 100 iterations stays"));
    ASSERT_TRUE(sweeper_.Sweep().ok());
    EXPECT_EQ(*blobs_->Get(BlobKey(id, finished_.blob)), "finished");
  }

  int64_t now_ms_ = 1'000'000;
  Clock clock_ = [this] { return now_ms_; };
  TempDir dir_;
  DataDir data_ = *DataDir::Open(dir_.path());
  std::unique_ptr<JobStore> store_ = *OpenSqliteJobStore(data_.database());
  std::unique_ptr<BlobStore> blobs_ = *OpenDiskBlobStore(data_.blobs());
  Jobs jobs_{store_.get(), blobs_.get(), data_, clock_};
  Sweeper sweeper_{store_.get(), blobs_.get(), &jobs_.uploads(), data_, clock_};
  Leases leases_{store_.get(), blobs_.get(), {}, clock_};
  KeptFile finished_, half_way_;
};

TEST_F(FinishedTest, SceneStaysIfItsResumeIsCancelled) {
  const std::string id = SucceededJob();
  Extend(id);
  const Lease lease = HalfWay(id);
  ASSERT_TRUE(jobs_.Cancel(id).ok());
  ASSERT_TRUE(leases_.Stopped(lease).ok());
  ExpectFinishedSceneIsThere(id, JobState::kCancelled);
  EXPECT_FALSE(blobs_->Get(BlobKey(id, half_way_.blob)).ok());  // swept
}

TEST_F(FinishedTest, SceneStaysIfItsResumeIsCancelledBeforeItRuns) {
  const std::string id = SucceededJob();
  Extend(id);
  ASSERT_TRUE(jobs_.Cancel(id).ok());
  ExpectFinishedSceneIsThere(id, JobState::kCancelled);
}

TEST_F(FinishedTest, SceneStaysIfItsResumeFailsOrItsWorkersDie) {
  const std::string id = SucceededJob();
  Extend(id);
  ASSERT_TRUE(leases_.Fail(HalfWay(id), absl::InternalError("x")).ok());
  ExpectFinishedSceneIsThere(id, JobState::kFailed);
  ASSERT_TRUE(jobs_.Resume(id).ok());
  for (int attempt = 1; attempt <= 3; ++attempt) {
    HalfWay(id);
    ASSERT_TRUE(leases_.WorkerDied("w", "killed by signal 9").ok());
  }
  ExpectFinishedSceneIsThere(id, JobState::kFailed);
}

TEST_F(FinishedTest, BetterSceneTakesItsPlace) {
  const std::string id = SucceededJob();
  Extend(id);
  ASSERT_TRUE(jobs_.Cancel(id).ok());
  ASSERT_TRUE(jobs_.Resume(id).ok());
  const Lease lease = HalfWay(id);
  ReconstructReport report;
  report.iterations = 200;
  KeptFiles kept = *Decode<KeptFiles>(jobs_.Get(id)->kept);
  const KeptFile better = kept[kSceneFile] = Scene(lease, "better");
  ASSERT_TRUE(leases_.Succeed(lease, report, kept).ok());
  const JobRecord job = *jobs_.Get(id);
  EXPECT_EQ(*Decode<KeptFiles>(job.kept), (KeptFiles{{kSceneFile, better}}));
  EXPECT_EQ(Decode<ReconstructReport>(job.report)->iterations, 200);
  ASSERT_TRUE(sweeper_.Sweep().ok());
  EXPECT_FALSE(blobs_->Get(BlobKey(id, finished_.blob)).ok());
}

TEST_F(FinishedTest, JobThatFailedForItsFilesTakesOthers) {
  const std::string id = UploadedJob();
  ASSERT_TRUE(jobs_.Start(id).ok());
  const Lease lease = Acquired();
  const KeptFile scene = Scene(lease, "x");
  ASSERT_TRUE(leases_.Keep(lease, {{kSceneFile, scene}}, 10).ok());
  ASSERT_TRUE(leases_.Fail(lease, InvalidInput("BLACK_IMAGE", "images[a.jpg]", "black")).ok());
  ASSERT_TRUE(jobs_.uploads().Query(id, {{"d.jpg", FileRole::kPhoto, 1, "d"}}).ok());
  EXPECT_EQ(jobs_.Get(id)->state, JobState::kFailed);  // a question changes nothing
  EXPECT_EQ(jobs_.Get(id)->expire_time_ms, 0);

  ASSERT_TRUE(Add(id, "a.jpg", "a brighter one").ok());
  JobRecord job = *jobs_.Get(id);
  EXPECT_EQ(job.state, JobState::kUploading);
  EXPECT_GT(job.expire_time_ms, 0);
  EXPECT_EQ(job.photos, 3);
  EXPECT_EQ(job.error + job.kept + job.progress, "");  // of the old photos
  EXPECT_EQ(job.snapshot_iteration, -1);
  EXPECT_FALSE(blobs_->Get(BlobKey(id, scene.blob)).ok()) << "counts for nobody, so it must go";
  ASSERT_TRUE(jobs_.Start(id).ok());
  const Lease next = Acquired();
  ASSERT_TRUE(leases_.Succeed(next, {}, {{kSceneFile, Scene(next, "new")}}).ok());
  EXPECT_EQ(jobs_.Get(id)->state, JobState::kSucceeded);
  EXPECT_EQ(Reason(Add(id, "a.jpg", "another")), "JOB_NOT_UPLOADING");
}

TEST_F(FinishedTest, JobWithOtherFilesIsStartedByTheCallThatStartedItBefore) {
  const std::string id = UploadedJob();
  ASSERT_TRUE(jobs_.Start(id, "s").ok());
  ASSERT_TRUE(leases_.Fail(Acquired(), absl::InternalError("x")).ok());
  ASSERT_TRUE(Add(id, "d.jpg", "d").ok());
  EXPECT_EQ(jobs_.Start(id, "s")->state, JobState::kQueued);
}

TEST_F(FinishedTest, ThereIsNoSuccessWithoutAScene) {
  const std::string id = UploadedJob();
  ASSERT_TRUE(jobs_.Start(id).ok());
  const Lease lease = Acquired();
  EXPECT_EQ(Reason(leases_.Succeed(lease, {}, {{"checkpoint", Scene(lease, "x")}})),
            "SCENE_MISSING");
  EXPECT_EQ(jobs_.Get(id)->state, JobState::kRunning);
}

TEST_F(FinishedTest, CallsThatChangeNoFileCostAFailedJobNothing) {
  const std::string id = UploadedJob();
  ASSERT_TRUE(jobs_.Start(id).ok());
  const Lease lease = Acquired();
  ASSERT_TRUE(leases_.Keep(lease, {{kSceneFile, Scene(lease, "x")}}, 10).ok());
  ASSERT_TRUE(leases_.Fail(lease, absl::InternalError("x")).ok());
  const JobRecord failed = *jobs_.Get(id);

  EXPECT_FALSE(*jobs_.uploads().Remove(id, FileRole::kPhoto, "d.jpg"));
  const FileRecord file{"d.jpg", FileRole::kPhoto, 9, Sha256::Hex("d")};
  EXPECT_EQ(Reason(jobs_.uploads().Open(id, file, 5).status()), "OFFSET_INVALID");
  EXPECT_FALSE(*jobs_.uploads().Adopt(id, file));
  const JobRecord job = *jobs_.Get(id);
  EXPECT_EQ(job.state, JobState::kFailed);
  EXPECT_EQ(job.kept, failed.kept);
  EXPECT_EQ(job.last_event, failed.last_event);
  EXPECT_TRUE(jobs_.Resume(id).ok());
}

TEST_F(FinishedTest, FailedJobThatLosesAFileStartsAfresh) {
  const std::string id = UploadedJob();
  ASSERT_TRUE(Add(id, "d.jpg", "d").ok());
  ASSERT_TRUE(jobs_.Start(id).ok());
  const Lease lease = Acquired();
  const KeptFile scene = Scene(lease, "x");
  ASSERT_TRUE(leases_.Keep(lease, {{kSceneFile, scene}}, 10).ok());
  ASSERT_TRUE(leases_.Fail(lease, absl::InternalError("x")).ok());
  EXPECT_TRUE(*jobs_.uploads().Remove(id, FileRole::kPhoto, "d.jpg"));
  EXPECT_EQ(jobs_.Get(id)->state, JobState::kUploading);
  EXPECT_GT(jobs_.Get(id)->expire_time_ms, 0);
  EXPECT_FALSE(blobs_->Get(BlobKey(id, scene.blob)).ok());
  EXPECT_EQ(Reason(jobs_.Resume(id).status()), "JOB_NOT_RESUMABLE");
  EXPECT_TRUE(jobs_.Start(id).ok());
}

TEST_F(FinishedTest, JobWithAFinishedSceneTakesNoOtherFiles) {
  const std::string id = SucceededJob();
  Extend(id);
  ASSERT_TRUE(leases_.Fail(HalfWay(id), absl::InternalError("x")).ok());
  EXPECT_EQ(Reason(Add(id, "d.jpg", "d")), "JOB_NOT_UPLOADING");
  EXPECT_EQ(Reason(jobs_.uploads().Query(id, {{"d.jpg", FileRole::kPhoto, 1, "d"}}).status()),
            "JOB_NOT_UPLOADING");
  ExpectFinishedSceneIsThere(id, JobState::kFailed);
}

TEST_F(FinishedTest, FileThatComesWhileItsJobFailsIsRefused) {
  const std::string id = UploadedJob();
  const FileRecord late{"d.jpg", FileRole::kArchive, 1, Sha256::Hex("d")};
  ASSERT_TRUE(jobs_.Start(id).ok());
  ASSERT_TRUE(leases_.Fail(Acquired(), absl::InternalError("x")).ok());
  EXPECT_EQ(Reason(jobs_.uploads().NoteArchive(id, late)), "JOB_NOT_UPLOADING");
}

TEST_F(FinishedTest, NoJobIsStartedForDepthMapsThatItDoesNotHave) {
  ReconstructOptions options;
  options.depth_source = DepthOrigin::kMaps;
  const std::string id = UploadedJob(options);
  const absl::Status refused = jobs_.Start(id).status();
  EXPECT_EQ(refused.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_EQ(Reason(refused), "DEPTH_MAPS_MISSING");
  ASSERT_TRUE(Add(id, "a.png", "depth", FileRole::kDepth).ok());
  EXPECT_TRUE(jobs_.Start(id).ok());
  for (const DepthOrigin source : {DepthOrigin::kMaps, DepthOrigin::kAuto}) {
    options.depth_source = source;
    const std::string foreign = UploadedJob(options);
    ASSERT_TRUE(Add(foreign, "other.png", "depth", FileRole::kDepth).ok());
    EXPECT_EQ(Reason(jobs_.Start(foreign).status()), "DEPTH_MAP_WITHOUT_PHOTO");
  }
  options.depth_source = DepthOrigin::kMaps;
  options.method = Method::k3dgs;  // which uses no depth
  EXPECT_TRUE(jobs_.Start(UploadedJob(options)).ok());
}

TEST_F(FinishedTest, NoJobWaitsForADepthNetworkThatNobodyHas) {
  ReconstructOptions options;
  options.depth_source = DepthOrigin::kNetwork;
  const std::string id = UploadedJob(options);
  const auto there = [&](const char* name, std::vector<std::string> labels) {
    ASSERT_TRUE(
        store_->PutWorker({name, store_->NowMs(), Encode(Resources{1, 1, std::move(labels)})})
            .ok());
  };
  there("w1", {});
  const absl::Status refused = jobs_.Start(id).status();
  EXPECT_EQ(refused.code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_EQ(Reason(refused), "DEPTH_MODEL_MISSING");
  EXPECT_EQ(jobs_.Get(id)->state, JobState::kUploading);
  there("w2", {kDepthNetworkLabel});
  ASSERT_TRUE(jobs_.Start(id).ok());
  EXPECT_FALSE(leases_.Acquire("w1", {1, 1, {}})->has_value());
  EXPECT_TRUE(leases_.Acquire("w2", {1, 1, {kDepthNetworkLabel}})->has_value());
}

}  // namespace
}  // namespace litags
