// What every job store must do, whatever keeps it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "engine/core/error.h"
#include "engine/core/error_test_util.h"
#include "server/store/job_store.h"
#include "server/testing/job_store_kind.h"

namespace litags {
namespace {

using ::testing::ElementsAre;

class JobStoreConformance : public StoreConformance {};

TEST_F(JobStoreConformance, EveryFieldSurvivesWritingAndReopening) {
  JobRecord job = MakeJob("a1", 1000, JobState::kRunning);
  job.owner = "alice";
  job.request_id = "req";
  job.request_digest = "00ff";
  job.clone_source = "b1";
  job.display_name = "my \"fox\"; DROP TABLE jobs";
  job.cancel_requested = true;
  job.attempt = 2;
  job.lease_owner = "w1";
  job.lease_expires_ms = 5;
  job.start_time_ms = 6;
  job.end_time_ms = 7;
  job.snapshot_iteration = 250;
  job.kept = "{\"scene\":1}";
  job.has_unreferenced_blobs = true;
  job.unreferenced_bytes = 9;
  job.kept_bytes = 10;
  job.preview_bytes = 11;
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
  EXPECT_EQ(read->request_digest, job.request_digest);
  EXPECT_EQ(read->clone_source, job.clone_source);
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
  EXPECT_EQ(read->kept, job.kept);
  EXPECT_TRUE(read->has_unreferenced_blobs);
  EXPECT_EQ(read->unreferenced_bytes, 9);
  EXPECT_EQ(read->kept_bytes, 10);
  EXPECT_EQ(read->preview_bytes, 11);
  EXPECT_EQ(read->options, job.options);
  EXPECT_EQ(read->progress, job.progress);
  EXPECT_EQ(read->error, job.error);
  EXPECT_EQ(read->report, job.report);
}

TEST_F(JobStoreConformance, SameRequestIdReturnsTheFirstJobUnchanged) {
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

TEST_F(JobStoreConformance, OwnersHaveRequestIdsListsAndSumsOfTheirOwn) {
  JobRecord hers = MakeJob("a1", 1), his = MakeJob("b1", 2), his_next = MakeJob("b2", 3);
  hers.owner = "alice";
  his.owner = his_next.owner = "bob";
  hers.request_id = his.request_id = "same";
  ASSERT_TRUE(store_->Create(hers, Nothing).ok());
  EXPECT_EQ(store_->Create(his, Nothing)->id, "b1");
  EXPECT_EQ((*store_->FindRequest("bob", "same"))->id, "b1");
  EXPECT_FALSE(store_->FindRequest("bob", "other")->has_value());
  EXPECT_FALSE(store_->FindRequest("bob", "")->has_value());
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
  EXPECT_EQ(store_->UsageOf("bob")->jobs, 2);
  EXPECT_EQ(store_->UsageOf("bob")->bytes, 14);
  EXPECT_EQ(store_->UsageOf("alice")->bytes, 7);
  EXPECT_EQ(store_->UsageOf("carol")->jobs, 0);

  ASSERT_TRUE(store_
                  ->Update("b2",
                           [](JobTransaction& job) {
                             job.job.state = JobState::kCancelled;
                             return absl::OkStatus();
                           })
                  .ok());
  EXPECT_THAT(*store_->Uploading("bob"), ElementsAre("b1"));
  EXPECT_THAT(*store_->Uploading("carol"), ElementsAre());
}

TEST_F(JobStoreConformance, UnknownJobIsNotFoundInEveryCall) {
  for (const absl::Status& status :
       {store_->Get("none").status(), store_->Update("none", Nothing).status(),
        store_->Files("none").status(), store_->Events("none", 0, 10).status(),
        store_->Log("none", 0, 10).status(),
        store_->File("none", FileRole::kPhoto, "a.jpg").status(),
        store_->Tally("none", "00").status()}) {
    EXPECT_EQ(status.code(), absl::StatusCode::kNotFound);
    EXPECT_EQ(Reason(status), "JOB_NOT_FOUND");
  }
}

TEST_F(JobStoreConformance, FailedChangeLeavesTheJobItsEventsAndItsFilesAsTheyWere) {
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

TEST_F(JobStoreConformance, FilesAreReplacedByNameAndCounted) {
  ASSERT_TRUE(store_->Create(MakeJob("a1", 1), Nothing).ok());
  const auto put = [&](const FileRecord& file) {
    return store_->Update("a1", [&](JobTransaction& job) { return job.PutFile(file); });
  };
  ASSERT_TRUE(put({"b.jpg", FileRole::kPhoto, 10, "00", 4, 3}).ok());
  ASSERT_TRUE(put({"a.jpg", FileRole::kPhoto, 20, "11", 4, 3}).ok());
  ASSERT_TRUE(put({"a.jpg", FileRole::kDepth, 100, "22", 0, 0}).ok());
  const auto job = put({"b.jpg", FileRole::kPhoto, 30, "33", 4, 3, "is dark"});
  ASSERT_TRUE(job.ok());
  EXPECT_EQ(job->photos, 2);
  EXPECT_EQ(job->bytes, 150);
  EXPECT_EQ(store_->Get("a1")->bytes, 150);
  EXPECT_EQ((*store_->File("a1", FileRole::kDepth, "a.jpg"))->size_bytes, 100);
  EXPECT_EQ((*store_->File("a1", FileRole::kPhoto, "b.jpg"))->about, "is dark");
  EXPECT_FALSE(store_->File("a1", FileRole::kMask, "a.jpg")->has_value());
  ASSERT_TRUE(store_->Create(MakeJob("a2", 1), Nothing).ok());
  for (const char* name : {"c.jpg", "d.jpg"}) {
    const FileRecord same{name, FileRole::kPhoto, 20, "11", 4, 3};
    const auto change = [&](JobTransaction& other) { return other.PutFile(same); };
    ASSERT_TRUE(store_->Update("a2", change).ok());
  }
  EXPECT_EQ(store_->Tally("a1", "11")->files, 3);
  EXPECT_EQ(store_->Tally("a1", "11")->same_bytes, 1);
  EXPECT_EQ(store_->Tally("a1", "00")->same_bytes, 0);
  EXPECT_EQ(store_->Tally("a2", "11")->same_bytes, 2);
  const auto files = store_->Files("a1");
  ASSERT_EQ(files->size(), 3u);
  EXPECT_EQ((*files)[0].name, "a.jpg");
  EXPECT_EQ((*files)[1].sha256, "33");
  EXPECT_EQ((*files)[1].width, 4);
  EXPECT_EQ((*files)[1].about, "is dark");
  EXPECT_EQ((*files)[2].role, FileRole::kDepth);
}

TEST_F(JobStoreConformance, RemoveTakesFilesAndEventsAlong) {
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

TEST_F(JobStoreConformance, ListPagesNewestFirstWithoutGapOrRepeatAlsoAtEqualTimes) {
  for (const auto& [id, time] : std::vector<std::pair<std::string, int64_t>>{
           {"a", 10}, {"b", 20}, {"c", 20}, {"d", 20}, {"e", 30}}) {
    ASSERT_TRUE(store_->Create(MakeJob(id, time), Nothing).ok());
  }
  const auto seen = [&](ListOrder order) {
    std::vector<std::string> ids;
    for (JobRecord last;; last = *store_->Get(ids.back())) {
      const auto page = store_->List(last.create_time_ms, last.id, 2, std::nullopt, order);
      EXPECT_TRUE(page.ok()) << page.status();
      if (page->empty()) return ids;
      for (const JobRecord& job : *page) ids.push_back(job.id);
    }
  };
  EXPECT_THAT(seen(ListOrder::kNewestFirst), ElementsAre("e", "d", "c", "b", "a"));
  EXPECT_THAT(seen(ListOrder::kOldestFirst), ElementsAre("a", "b", "c", "d", "e"));
}

TEST_F(JobStoreConformance, FilesAreRemovedAndTheirBytesNotCounted) {
  ASSERT_TRUE(store_->Create(MakeJob("a1", 1), Nothing).ok());
  const auto job = store_->Update("a1", [](JobTransaction& transaction) -> absl::Status {
    LITAGS_RETURN_IF_ERROR(transaction.PutFile({"a.jpg", FileRole::kPhoto, 7, "00", 1, 1}));
    LITAGS_RETURN_IF_ERROR(transaction.PutFile({"b.jpg", FileRole::kPhoto, 5, "11", 1, 1}));
    LITAGS_RETURN_IF_ERROR(transaction.RemoveFile(FileRole::kPhoto, "a.jpg"));
    return transaction.RemoveFile(FileRole::kMask, "b.jpg");
  });
  ASSERT_TRUE(job.ok()) << job.status();
  EXPECT_EQ(job->photos, 1);
  EXPECT_EQ(job->bytes, 5);
  EXPECT_EQ(store_->Files("a1")->at(0).name, "b.jpg");
}

TEST_F(JobStoreConformance, ALogIsKeptInOrderAndCounted) {
  ASSERT_TRUE(store_->Create(MakeJob("a1", 1), Nothing).ok());
  const auto add = [](JobTransaction& job) -> absl::Status {
    LITAGS_RETURN_IF_ERROR(job.AddLog({0, 5, LogSeverity::kWarning, "first"}));
    return job.AddLog({0, 6, LogSeverity::kError, "two\nlines"});
  };
  const auto job = store_->Update("a1", add);
  ASSERT_TRUE(job.ok()) << job.status();
  EXPECT_EQ(job->last_log_entry, 2);
  EXPECT_EQ(job->log_bytes, 14);
  const auto log = *store_->Log("a1", 0, 10);
  ASSERT_EQ(log.size(), 2u);
  EXPECT_EQ(log[0].severity, LogSeverity::kWarning);
  EXPECT_EQ(log[1].text, "two\nlines");
  EXPECT_EQ(log[1].time_ms, 6);
  EXPECT_EQ(store_->Log("a1", 1, 10)->at(0).number, 2);
  EXPECT_EQ(store_->Log("a1", 0, 1)->size(), 1u);
  ASSERT_TRUE(store_->Update("a1", [](JobTransaction& t) { return t.Remove(); }).ok());
  ASSERT_TRUE(store_->Create(MakeJob("a1", 2), Nothing).ok());
  EXPECT_TRUE(store_->Log("a1", 0, 10)->empty());
}

TEST_F(JobStoreConformance, WorkersAreThereUntilTheyAreSilentOrRemoved) {
  ASSERT_TRUE(store_->PutWorker({"w2", 1000, "{}"}).ok());
  ASSERT_TRUE(store_->PutWorker({"w1", 2000, "{}"}).ok());
  ASSERT_TRUE(store_->PutWorker({"w2", 3000, "{\"cores\":2}"}).ok());
  const auto names = [&](int64_t since_ms) {
    std::vector<std::string> names;
    const auto workers = store_->Workers(since_ms);
    for (const WorkerRecord& worker : *workers) names.push_back(worker.name);
    return names;
  };
  EXPECT_THAT(names(0), ElementsAre("w1", "w2"));
  EXPECT_THAT(names(2001), ElementsAre("w2"));
  EXPECT_EQ(store_->Workers(3000)->at(0).resources, "{\"cores\":2}");
  ASSERT_TRUE(store_->RemoveWorker("w2").ok());
  ASSERT_TRUE(store_->RemoveWorker("w2").ok()) << "it is gone already";
  EXPECT_THAT(names(0), ElementsAre("w1"));
  // One that died without a word long ago is forgotten.
  constexpr int64_t kTwoDaysMs = int64_t{48} * 3600 * 1000;
  ASSERT_TRUE(store_->PutWorker({"w3", kTwoDaysMs, "{}"}).ok());
  EXPECT_THAT(names(0), ElementsAre("w3"));
  ASSERT_TRUE(store_->PutWorker({"w4", kTwoDaysMs - 3'600'000, "{}"}).ok());
  EXPECT_THAT(names(0), ElementsAre("w4")) << "the clock was set back";
}

TEST_F(JobStoreConformance, TextsAreOrderedByTheirBytesAndKeptAsTheyAre) {
  ASSERT_TRUE(store_->Create(MakeJob("a1", 1), Nothing).ok());
  const std::vector<std::string> names = {"B 'quoted' \\ ?1 $1", "Z", "a",
                                          "\xc3\xa4\xf0\x9f\x93\xb7"};
  ASSERT_TRUE(
      store_
          ->Update("a1",
                   [&](JobTransaction& job) -> absl::Status {
                     for (auto name = names.rbegin(); name != names.rend(); ++name) {
                       LITAGS_RETURN_IF_ERROR(job.PutFile({*name, FileRole::kPhoto, 1, "0"}));
                     }
                     return absl::OkStatus();
                   })
          .ok());
  const auto files = store_->Files("a1");
  ASSERT_EQ(files->size(), names.size());
  for (size_t i = 0; i < names.size(); ++i) EXPECT_EQ((*files)[i].name, names[i]);
}

TEST_F(JobStoreConformance, NumbersBeyond32BitsAndLongTextsAreKept) {
  JobRecord job = MakeJob("a1", int64_t{1} << 60);
  job.progress = std::string(3'000'000, 'x');
  ASSERT_TRUE(store_->Create(job, Nothing).ok());
  EXPECT_EQ(store_->Get("a1")->create_time_ms, job.create_time_ms);
  EXPECT_EQ(store_->Get("a1")->progress, job.progress);
  EXPECT_EQ(store_->List(job.create_time_ms, "b", 10)->size(), 1u);
}

TEST_F(JobStoreConformance, FileOfTheSameBytesIsFoundInTheOwnJobFirstAndNotAtOthers) {
  for (const auto& [id, owner] : std::vector<std::pair<std::string, std::string>>{
           {"a1", "alice"}, {"a2", "alice"}, {"b1", "bob"}}) {
    JobRecord job = MakeJob(id, 1);
    job.owner = owner;
    ASSERT_TRUE(store_
                    ->Create(job,
                             [](JobTransaction& job) {
                               return job.PutFile({"x.jpg", FileRole::kPhoto, 1, "d1"});
                             })
                    .ok());
  }
  JobRecord empty = MakeJob("b2", 1), stranger = MakeJob("c1", 1);
  empty.owner = "bob";
  stranger.owner = "carol";
  ASSERT_TRUE(store_->Create(empty, Nothing).ok());
  ASSERT_TRUE(store_->Create(stranger, Nothing).ok());
  const auto found_in = [&](const std::string& id, FileRole role = FileRole::kPhoto) {
    const auto file = store_->FindFile(id, role, "d1");
    return *file ? (*file)->job_id : std::string();
  };
  EXPECT_EQ(found_in("a2"), "a2");
  EXPECT_EQ(found_in("b2"), "b1");
  EXPECT_EQ(found_in("c1"), "");
  EXPECT_EQ(found_in("a1", FileRole::kDepth), "");
}

TEST_F(JobStoreConformance, ExpiredJobsAreListedOldestFirst) {
  for (const auto& [id, time] :
       std::vector<std::pair<std::string, int64_t>>{{"a", 30}, {"b", 10}, {"c", 0}, {"d", 20}}) {
    JobRecord job = MakeJob(id, 1);
    job.expire_time_ms = time;
    ASSERT_TRUE(store_->Create(job, Nothing).ok());
  }
  EXPECT_THAT(*store_->Expired(20, 10), ElementsAre("b", "d"));
  EXPECT_THAT(*store_->Expired(30, 1), ElementsAre("b"));
}

TEST_F(JobStoreConformance, OfDueWebhooksTheOldestOfEachOwnerIsListed) {
  const struct {
    const char *id, *owner;
    int64_t due_ms;
  } kJobs[] = {{"a1", "alice", 30}, {"a2", "alice", 10}, {"a3", "alice", 11},
               {"b1", "bob", 20},   {"b2", "bob", 0},    {"c1", "carol", 40}};
  for (const auto& [id, owner, due_ms] : kJobs) {
    JobRecord job = MakeJob(id, 1);
    job.owner = owner;
    job.webhook_due_ms = due_ms;
    ASSERT_TRUE(store_->Create(job, Nothing).ok());
  }
  EXPECT_THAT(*store_->WebhooksDue(30, 40, 10), ElementsAre("a2", "b1"));
  EXPECT_THAT(*store_->WebhooksDue(30, 40, 1), ElementsAre("a2"));
  EXPECT_THAT(*store_->WebhooksDue(9, 40, 10), ElementsAre());
  EXPECT_THAT(*store_->WebhooksDue(9, 29, 10), ElementsAre("a1", "c1"));
}

TEST_F(JobStoreConformance, InstallationIdIsMadeOnceAndOtherDatabasesHaveOthers) {
  const std::string id = *store_->InstallationId();
  EXPECT_EQ(id.size(), 32u);
  EXPECT_EQ(*store_->InstallationId(), id);
  store_.reset();
  EXPECT_EQ(*Open()->InstallationId(), id);
  EXPECT_NE(*(*MakeTestedKind()->Open())->InstallationId(), id);
}

TEST_F(JobStoreConformance, ClockIsThatOfThisMachineWhereTheStoreIsOnIt) {
  EXPECT_TRUE(store_->Get("none").status().code() == absl::StatusCode::kNotFound);
  EXPECT_NEAR(static_cast<double>(store_->NowMs()), static_cast<double>(SystemClockMs()), 2000);
}

TEST_F(JobStoreConformance, JobsOfTheOldestVersionAreKept) {
  store_.reset();
  const auto kind = MakeTestedKind();
  ASSERT_TRUE(kind->MakeOldest().ok());
  auto store = kind->Open();
  ASSERT_TRUE(store.ok()) << store.status();
  const auto job = (*store)->Get("a1");
  ASSERT_TRUE(job.ok()) << job.status();
  EXPECT_EQ(job->owner, "alice");
  EXPECT_EQ(job->request_id, "req");
  EXPECT_EQ(job->state, JobState::kQueued);
  JobRecord again = MakeJob("a2", 2);
  again.owner = "alice";
  again.request_id = "req";
  EXPECT_EQ((*store)->Create(again, Nothing)->id, "a1");
  EXPECT_TRUE(kind->Open().ok()) << "migrating twice";
}

TEST_F(JobStoreConformance, DatabasesThatAreTooNewOrTooOldAreRefused) {
  EXPECT_TRUE(kind_->Check().ok());
  ASSERT_TRUE(kind_->SetVersion(99).ok());
  EXPECT_EQ(Reason(kind_->Open().status()), "STORE_TOO_NEW");
  EXPECT_EQ(Reason(kind_->Check()), "STORE_TOO_NEW");
  ASSERT_TRUE(kind_->SetVersion(3).ok());
  EXPECT_EQ(Reason(kind_->Open().status()), "STORE_TOO_OLD");
  EXPECT_EQ(Reason(kind_->Check()), "STORE_TOO_OLD");
}

}  // namespace
}  // namespace litags
