#include "server/jobs/client_job_store.h"
#include "engine/core/error_test_util.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>

#include "engine/core/temp_dir_test_util.h"
#include "server/testing/job_store_kind.h"

namespace litags {
namespace {

constexpr ListOrder kOrder = ListOrder::kNewestFirst;

using ::testing::HasSubstr;

std::function<absl::Status(JobTransaction&)> PutBytes(int64_t bytes) {
  return [bytes](JobTransaction& job) {
    return job.PutFile({"a", FileRole::kPhoto, bytes, "00", 1, 1});
  };
}

class ClientJobStoreTest : public ::testing::Test {
 protected:
  ClientJobStoreTest() {
    EXPECT_TRUE(alice_.Create(MakeJob("a1"), Nothing).ok());
    EXPECT_TRUE(bob_.Create(MakeJob("b1"), Nothing).ok());
  }

  TempDir dir_;
  std::unique_ptr<JobStore> store_ = *OpenSqliteJobStore(dir_.path() + "/jobs.db");
  ClientJobStore alice_{store_.get(), {.owner = "alice", .max_jobs = 2, .max_bytes = 10}};
  ClientJobStore bob_{store_.get(), {.owner = "bob"}};
  ClientJobStore admin_{store_.get(), {.owner = "root", .sees_all = true}};
};

TEST_F(ClientJobStoreTest, JobsBelongToTheClientThatMadeThem) {
  EXPECT_EQ(store_->Get("a1")->owner, "alice");
  EXPECT_EQ(store_->Get("b1")->owner, "bob");
}

TEST_F(ClientJobStoreTest, EveryCallTreatsJobsOfOthersAsNotThere) {
  const absl::Status missing = bob_.Get("none").status();
  for (const absl::Status& status :
       {bob_.Get("a1").status(), bob_.Update("a1", Nothing).status(), bob_.Files("a1").status(),
        bob_.File("a1", FileRole::kPhoto, "a.jpg").status(), bob_.Tally("a1", "00").status(),
        bob_.Events("a1", 0, 1).status(), bob_.Log("a1", 0, 1).status()}) {
    EXPECT_EQ(Reason(status), "JOB_NOT_FOUND");
    EXPECT_EQ(status.code(), missing.code());
  }
  // Nor does its message differ from that of a job that never was.
  EXPECT_EQ(bob_.Get("a1").status().message(),
            "there is no job jobs/a1; ListJobs names those there are");
  EXPECT_EQ(bob_.List(0, "", 10, std::nullopt, kOrder)->size(), 1u);
  EXPECT_TRUE(bob_.List(0, "", 10, "alice", kOrder)->empty());
  JobRecord repeatable = MakeJob("a2");
  repeatable.request_id = "once";
  ASSERT_TRUE(alice_.Create(repeatable, Nothing).ok());
  EXPECT_TRUE(alice_.FindRequest("alice", "once")->has_value());
  EXPECT_FALSE(bob_.FindRequest("alice", "once")->has_value());
}

TEST_F(ClientJobStoreTest, OwnersAndAdministratorsReachTheJob) {
  for (ClientJobStore* client : {&alice_, &admin_}) {
    EXPECT_TRUE(client->Get("a1").ok());
    EXPECT_TRUE(client->Update("a1", Nothing).ok());
    EXPECT_TRUE(client->Files("a1").ok());
    EXPECT_TRUE(client->Events("a1", 0, 1).ok());
    EXPECT_TRUE(client->Log("a1", 0, 1).ok());
  }
  EXPECT_EQ(admin_.List(0, "", 10, std::nullopt, kOrder)->size(), 2u);
  EXPECT_EQ(admin_.List(0, "", 10, "bob", kOrder)->at(0).id, "b1");
}

TEST_F(ClientJobStoreTest, JobsFromBeforeThereWereTokensAreTheAdministrators) {
  ASSERT_TRUE(store_->Create(MakeJob("n1"), Nothing).ok());
  EXPECT_EQ(Reason(alice_.Get("n1").status()), "JOB_NOT_FOUND");
  const auto seen = alice_.List(0, "", 10, std::nullopt, kOrder);
  ASSERT_EQ(seen->size(), 1u);
  EXPECT_EQ(seen->at(0).id, "a1");
  EXPECT_TRUE(alice_.List(0, "", 10, "", kOrder)->empty());
  EXPECT_TRUE(admin_.Get("n1").ok());
  EXPECT_EQ(admin_.List(0, "", 10, "", kOrder)->at(0).id, "n1");
}

TEST_F(ClientJobStoreTest, JobsAreCountedPerClient) {
  EXPECT_TRUE(alice_.Create(MakeJob("a2"), Nothing).ok());
  const absl::Status third = alice_.Create(MakeJob("a3"), Nothing).status();
  EXPECT_EQ(third.code(), absl::StatusCode::kResourceExhausted);
  EXPECT_EQ(Reason(third), "JOB_QUOTA_REACHED");
  EXPECT_THAT(std::string(third.message()), HasSubstr("has 2 jobs, and may have 2"));
  EXPECT_FALSE(store_->Get("a3").ok());
  EXPECT_TRUE(bob_.Create(MakeJob("b2"), Nothing).ok());
  ASSERT_TRUE(alice_.Update("a2", [](JobTransaction& job) { return job.Remove(); }).ok());
  EXPECT_TRUE(alice_.Create(MakeJob("a3"), Nothing).ok());
}

TEST_F(ClientJobStoreTest, BytesAreCountedOverAllJobsOfAClient) {
  EXPECT_TRUE(alice_.Create(MakeJob("a2"), Nothing).ok());
  EXPECT_TRUE(alice_.Update("a1", PutBytes(6)).ok());
  const absl::Status more = alice_.Update("a2", PutBytes(5)).status();
  EXPECT_EQ(Reason(more), "BYTE_QUOTA_REACHED");
  EXPECT_THAT(std::string(more.message()), HasSubstr("would hold 11 bytes, and may hold 10"));
  EXPECT_EQ(store_->Get("a2")->bytes, 0);
  EXPECT_TRUE(alice_.Update("a2", PutBytes(4)).ok());
}

TEST_F(ClientJobStoreTest, ResultsCountAndAboveTheQuotaNothingIsStarted) {
  EXPECT_TRUE(alice_.Create(MakeJob("a2"), Nothing).ok());
  const auto start = [](JobTransaction& job) {
    job.job.state = JobState::kQueued;
    return absl::OkStatus();
  };
  ASSERT_TRUE(alice_.Update("a1", start).ok());
  // Its worker is not held up.
  const auto leave_results = [](JobTransaction& job) {
    job.job.kept_bytes = 8;
    job.job.preview_bytes = 3;
    return absl::OkStatus();
  };
  ASSERT_TRUE(store_->Update("a1", leave_results).ok());
  EXPECT_EQ(store_->UsageOf("alice")->bytes, 11);
  EXPECT_EQ(Reason(alice_.Update("a2", start).status()), "BYTE_QUOTA_REACHED");
  EXPECT_EQ(Reason(alice_.Update("a2", PutBytes(1)).status()), "BYTE_QUOTA_REACHED");
  EXPECT_TRUE(alice_.Update("a2", Nothing).ok());
  ASSERT_TRUE(alice_.Update("a1", [](JobTransaction& job) { return job.Remove(); }).ok());
  EXPECT_TRUE(alice_.Update("a2", start).ok());
}

TEST_F(ClientJobStoreTest, ClientAboveALoweredQuotaMayStillDoWhatAddsNothing) {
  ClientJobStore before(store_.get(), {.owner = "alice"});
  ASSERT_TRUE(before.Update("a1", PutBytes(100)).ok());
  EXPECT_TRUE(alice_.Update("a1", Nothing).ok());
  EXPECT_TRUE(alice_.Update("a1", PutBytes(50)).ok());
  EXPECT_EQ(Reason(alice_.Update("a1", PutBytes(60)).status()), "BYTE_QUOTA_REACHED");
}

}  // namespace
}  // namespace litags
