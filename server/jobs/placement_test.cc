#include "server/jobs/placement.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "engine/core/error.h"
#include "engine/core/temp_dir_test_util.h"
#include "server/jobs/codec.h"
#include "server/jobs/jobs.h"
#include "server/jobs/leases.h"
#include "server/jobs/overview.h"

namespace litags {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr int64_t kGiB = int64_t{1} << 30;

TEST(Placement, WorkerMustHaveAllThatAJobNeeds) {
  const Resources has{8, 16 * kGiB, {"avx512", "site-b"}};
  EXPECT_TRUE(Fits(Resources{}, has));
  EXPECT_TRUE(Fits(Resources{8, 16 * kGiB, {"site-b"}}, has));
  EXPECT_FALSE(Fits(Resources{9, 0, {}}, has));
  EXPECT_FALSE(Fits(Resources{0, 16 * kGiB + 1, {}}, has));
  EXPECT_FALSE(Fits(Resources{0, 0, {"avx512", "site-a"}}, has));
  EXPECT_TRUE(Fits("", Resources{}));
  EXPECT_FALSE(Fits("not JSON", has));
}

TEST(Placement, EqualNeedsAreEqualTextsAndNoneIsEmpty) {
  JobPolicy policy;
  EXPECT_EQ(EncodedNeedsOf(policy, {}), "");
  policy.worker_labels = {"b", "a", "b"};
  JobPolicy other;
  other.worker_labels = {"a", "b"};
  EXPECT_EQ(EncodedNeedsOf(policy, {}), EncodedNeedsOf(other, {}));
  EXPECT_THAT(NeedsOf(policy, {}).labels, ElementsAre("a", "b"));
  ReconstructOptions network;
  network.depth_source = DepthOrigin::kNetwork;
  EXPECT_THAT(NeedsOf(policy, network).labels, ElementsAre("a", "b", kDepthNetworkLabel));
  network.method = Method::k3dgs;  // learns without depth
  EXPECT_THAT(NeedsOf(policy, network).labels, ElementsAre("a", "b"));
  policy.max_memory_bytes = 4 * kGiB;
  EXPECT_EQ(NeedsOf(policy, {}).memory_bytes, 4 * kGiB) << "what it may take it may need";
  policy.min_memory_bytes = kGiB;
  EXPECT_EQ(NeedsOf(policy, {}).memory_bytes, kGiB);
}

TEST(Placement, OtherLabelsLeaveTheOtherNeeds) {
  ReconstructOptions network;
  network.depth_source = DepthOrigin::kNetwork;
  JobPolicy policy;
  policy.min_cores = 4;
  policy.worker_labels = {"site-a"};
  const std::string before = EncodedNeedsOf(policy, network, 3 * kGiB);
  policy.worker_labels = {"site-b"};
  EXPECT_EQ(*NeedsWithLabelsOf(policy, network, before), EncodedNeedsOf(policy, network, 3 * kGiB));
  policy.worker_labels.clear();
  EXPECT_EQ(*NeedsWithLabelsOf(policy, {}, EncodedNeedsOf({}, network)), "");
  EXPECT_EQ(*NeedsWithLabelsOf(policy, {}, ""), "");
}

TEST(Placement, LabelsThatAreNoneAreRefused) {
  EXPECT_TRUE(CheckLabels({"avx512", "zone=eu.west_1/b"}, "labels").ok());
  for (const std::vector<std::string>& labels : std::vector<std::vector<std::string>>{
           {""}, {"a b"}, {"a,b"}, {std::string(64, 'a')}, std::vector<std::string>(9, "a")}) {
    EXPECT_EQ(GetErrorDetail(CheckLabels(labels, "policy.labels"))->reason, "LABEL_INVALID");
  }
}

class PlacementOfJobs : public ::testing::Test {
 protected:
  std::string QueuedJob(const JobPolicy& policy) {
    const auto job = jobs_.Create({"", "", "", {}, policy});
    EXPECT_TRUE(job.ok()) << job.status();
    const auto fill = [](JobTransaction& job) -> absl::Status {
      LITAGS_RETURN_IF_ERROR(job.PutFile({"a", FileRole::kPhoto, 1, "0", 4, 3}));
      LITAGS_RETURN_IF_ERROR(job.PutFile({"b", FileRole::kPhoto, 1, "1", 4, 3}));
      return job.PutFile({"c", FileRole::kPhoto, 1, "2", 4, 3});
    };
    EXPECT_TRUE(store_->Update(job->id, fill).ok());
    EXPECT_TRUE(jobs_.Start(job->id).ok());
    return job->id;
  }
  std::string WaitsForNow(const std::string& id) {
    return WaitsFor(*jobs_.Get(id), *jobs_.Workers());
  }
  void SayIsThere(const std::string& name, const Resources& has, int64_t age_ms = 0) {
    ASSERT_TRUE(store_->PutWorker({name, store_->NowMs() - age_ms, Encode(has)}).ok());
  }

  TempDir dir_;
  DataDir data_ = *DataDir::Open(dir_.path());
  std::unique_ptr<JobStore> store_ = *OpenSqliteJobStore(data_.database());
  std::unique_ptr<BlobStore> blobs_ = *OpenDiskBlobStore(data_.blobs());
  Jobs jobs_{store_.get(), blobs_.get(), data_};
  Leases leases_{store_.get(), blobs_.get()};
};

TEST_F(PlacementOfJobs, JobGoesToAWorkerThatFitsAndOthersPassItOver) {
  JobPolicy large;
  large.min_cores = 16;
  const std::string first = QueuedJob(large), second = QueuedJob({});
  const auto small = leases_.Acquire("small", {4, kGiB, {}});
  ASSERT_TRUE(small.ok() && small->has_value());
  EXPECT_EQ((*small)->job.id, second);
  EXPECT_FALSE(leases_.Acquire("small2", {15, kGiB, {}})->has_value());
  EXPECT_EQ((*leases_.Acquire("large", {16, kGiB, {}}))->job.id, first);
}

TEST_F(PlacementOfJobs, JobThatNobodyCanTakeSaysWhatItWaitsForAndIsCounted) {
  JobPolicy policy;
  policy.min_cores = 64;
  policy.worker_labels = {"avx512"};
  const std::string id = QueuedJob(policy);
  EXPECT_THAT(WaitsForNow(id), HasSubstr("none is there"));
  EXPECT_EQ(OverviewOf(*store_, SystemClockMs())->unplaceable, 1);
  SayIsThere("w1", {1, kGiB, {}});
  EXPECT_EQ(WaitsForNow(id),
            "a worker with 64 cores, label avx512; the only one that is there has 1 core and 1024 "
            "MiB");
  SayIsThere("w1", {8, kGiB, {}});
  SayIsThere("w2", {4, 2 * kGiB, {"avx512"}});
  EXPECT_EQ(WaitsForNow(id),
            "a worker with 64 cores, label avx512; of the 2 that are there none has all of it, the "
            "largest 8 cores and 2048 MiB");
  EXPECT_EQ(OverviewOf(*store_, SystemClockMs())->workers, 2);
  EXPECT_EQ(OverviewOf(*store_, SystemClockMs())->unplaceable, 1);
  SayIsThere("w3", {64, kGiB, {"avx512"}});
  EXPECT_EQ(WaitsForNow(id), "");
  EXPECT_EQ(OverviewOf(*store_, SystemClockMs())->unplaceable, 0);
  EXPECT_EQ(OverviewOf(*store_, SystemClockMs())->by_state[JobState::kQueued], 1);
}

TEST_F(PlacementOfJobs, MostMemoryThereIsIsToldAsItIs) {
  JobPolicy policy;
  policy.min_memory_bytes = std::numeric_limits<int64_t>::max();
  const std::string id = QueuedJob(policy);
  SayIsThere("w1", {1, kGiB, {}});
  EXPECT_THAT(WaitsForNow(id), HasSubstr("with 8796093022208 MiB of memory"));
}

TEST_F(PlacementOfJobs, WorkerThatIsSilentOrGoneIsNotThere) {
  SayIsThere("old", {8, kGiB, {}}, kWorkerSilenceMs + 1000);
  SayIsThere("new", {8, kGiB, {}}, kWorkerSilenceMs - 5000);
  EXPECT_EQ(jobs_.Workers()->size(), 1u);
  ASSERT_TRUE(leases_.WorkerDied("new", "killed").ok());
  EXPECT_TRUE(jobs_.Workers()->empty());
  SayIsThere("of before the clock was set back", {8, kGiB, {}}, -3'600'000);
  EXPECT_TRUE(jobs_.Workers()->empty());
}

}  // namespace
}  // namespace litags
