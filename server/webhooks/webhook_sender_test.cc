#include "server/webhooks/webhook_sender.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <future>
#include <map>
#include <thread>

#include "absl/strings/str_cat.h"
#include "engine/core/temp_dir_test_util.h"
#include "server/jobs/codec.h"
#include "server/jobs/jobs.h"
#include "server/jobs/jobs_test_util.h"
#include "server/jobs/leases.h"
#include "server/testing/forwarding_job_store.h"

namespace litags {
namespace {

using ::testing::HasSubstr;

const std::string kSecret(32, 's');

class WebhookSenderTest : public ::testing::Test {
 protected:
  struct Sent {
    std::string url, body;
    std::map<std::string, std::string> headers;
  };

  std::string StartedJob(Jobs& jobs) {
    NewJob wanted;
    wanted.webhook = {"https://example.com/hook", kSecret};
    return litags::StartedJob(jobs, data_, wanted);
  }
  std::string StartedJob() { return StartedJob(jobs_); }

  void EndJobOf(const std::string& client) {
    const auto jobs = jobs_.For({client});
    ASSERT_TRUE(jobs->Cancel(StartedJob(*jobs)).ok());
  }

  static absl::StatusOr<std::string> Body(const JobRecord& job) {
    return absl::StrCat("{\"job\":\"", job.id, "\",\"owner\":\"", job.owner, "\"}");
  }

  WebhookSender Sender(const std::string& hosts = "*") {
    return WebhookSender(
        store_.get(), {{hosts}}, Body,
        [this](const std::string& url, const std::string& body, const auto& headers) {
          sent_.push_back({url, body, {headers.begin(), headers.end()}});
          if (while_sending_) while_sending_();
          return answer_;
        },
        /*threads=*/0);
  }

  // As if the pause before the next attempt were over.
  void MakeDue(const std::string& id) {
    ASSERT_TRUE(store_
                    ->Update(id,
                             [](JobTransaction& job) {
                               EXPECT_GT(job.job.webhook_due_ms, SystemClockMs());
                               job.job.webhook_due_ms = 1;
                               return absl::OkStatus();
                             })
                    .ok());
  }

  TempDir dir_;
  DataDir data_ = *DataDir::Open(dir_.path());
  std::unique_ptr<JobStore> store_ = *OpenSqliteJobStore(data_.database());
  std::unique_ptr<BlobStore> blobs_ = *OpenDiskBlobStore(data_.blobs());
  Jobs jobs_{store_.get(), blobs_.get(), data_, nullptr, {}, {{"*"}}};
  absl::Status answer_;
  std::function<void()> while_sending_;
  std::vector<Sent> sent_;
};

TEST_F(WebhookSenderTest, AnEndIsToldOnceWithItsSignature) {
  WebhookSender sender = Sender();
  const std::string id = StartedJob();
  EXPECT_EQ(*sender.SendDue(), 0);
  ASSERT_TRUE(jobs_.Cancel(id).ok());
  EXPECT_EQ(*sender.SendDue(), 1);
  EXPECT_EQ(*sender.SendDue(), 0);
  ASSERT_EQ(sent_.size(), 1u);
  EXPECT_EQ(sent_[0].url, "https://example.com/hook");
  const int64_t event = jobs_.Get(id)->last_event;
  EXPECT_EQ(sent_[0].headers["Litags-Event"], absl::StrCat("jobs/", id, "/", event));
  EXPECT_EQ(
      sent_[0].headers["Litags-Signature"],
      WebhookSignature(kSecret, std::stoll(sent_[0].headers["Litags-Timestamp"]), sent_[0].body));
  EXPECT_EQ(WebhookOf(*jobs_.Get(id))->delivered_event, event);
}

TEST_F(WebhookSenderTest, AFailureIsTriedAgainLaterAndKnown) {
  WebhookSender sender = Sender();
  const std::string id = StartedJob();
  ASSERT_TRUE(jobs_.Cancel(id).ok());
  answer_ = absl::UnavailableError("nobody there");
  EXPECT_EQ(*sender.SendDue(), 1);
  EXPECT_EQ(*sender.SendDue(), 0);
  Webhook webhook = *WebhookOf(*jobs_.Get(id));
  EXPECT_EQ(webhook.attempts, 1);
  EXPECT_EQ(webhook.last_error, "nobody there");
  EXPECT_EQ(webhook.delivered_event, 0);
  MakeDue(id);
  answer_ = absl::OkStatus();
  EXPECT_EQ(*sender.SendDue(), 1);
  EXPECT_EQ(sent_[0].headers["Litags-Event"], sent_[1].headers["Litags-Event"]);
  webhook = *WebhookOf(*jobs_.Get(id));
  EXPECT_EQ(webhook.attempts, 2);
  EXPECT_EQ(webhook.last_error, "");
  EXPECT_GT(webhook.delivered_event, 0);
}

// Its clock was ahead when the job ended, or when an attempt failed.
TEST_F(WebhookSenderTest, AnEndOfBeforeTheClockWasSetBackIsToldNow) {
  class SetClock : public ForwardingJobStore {
   public:
    using ForwardingJobStore::ForwardingJobStore;
    int64_t NowMs() override { return ForwardingJobStore::NowMs() + ahead_ms; }
    int64_t ahead_ms = int64_t{30} * 24 * 3'600'000;
  };
  SetClock store(store_.get());
  Jobs jobs(&store, blobs_.get(), data_, StoreClock(&store), {}, {{"*"}});
  const std::string id = StartedJob(jobs);
  ASSERT_TRUE(jobs.Cancel(id).ok());
  answer_ = absl::UnavailableError("nobody there");
  int sent = 0;
  WebhookSender sender(
      &store, {{"*"}}, Body,
      [&](const auto&, const auto&, const auto&) {
        ++sent;
        return answer_;
      },
      /*threads=*/0);
  EXPECT_EQ(*sender.SendDue(), 1);
  EXPECT_EQ(*sender.SendDue(), 0) << "the pause";
  store.ahead_ms = 0;
  EXPECT_EQ(*sender.SendDue(), 1);
  EXPECT_EQ(*sender.SendDue(), 0) << "the pause by the clock as it is now";
  EXPECT_EQ(sent, 2);
}

TEST_F(WebhookSenderTest, WhatOneSenderHasTakenAnotherLeaves) {
  WebhookSender one = Sender(), other = Sender();
  const std::string id = StartedJob();
  ASSERT_TRUE(jobs_.Cancel(id).ok());
  while_sending_ = [&] {
    while_sending_ = nullptr;
    EXPECT_EQ(*other.SendDue(), 0);
  };
  EXPECT_EQ(*one.SendDue(), 1);
  EXPECT_EQ(sent_.size(), 1u);
}

TEST_F(WebhookSenderTest, EachEndIsTold) {
  WebhookSender sender = Sender();
  const std::string id = StartedJob();
  ASSERT_TRUE(jobs_.Cancel(id).ok());
  EXPECT_EQ(*sender.SendDue(), 1);
  ASSERT_TRUE(jobs_.Resume(id).ok());
  EXPECT_EQ(*sender.SendDue(), 0);
  ASSERT_TRUE(jobs_.Cancel(id).ok());
  // It goes on, and ends again, while its end is told.
  while_sending_ = [&] {
    while_sending_ = nullptr;
    ASSERT_TRUE(jobs_.Resume(id).ok());
    ASSERT_TRUE(jobs_.Cancel(id).ok());
  };
  EXPECT_EQ(*sender.SendDue(), 1);
  EXPECT_EQ(*sender.SendDue(), 1);
  EXPECT_EQ(*sender.SendDue(), 0);
  ASSERT_EQ(sent_.size(), 3u);
  EXPECT_NE(sent_[1].headers["Litags-Event"], sent_[2].headers["Litags-Event"]);
}

TEST_F(WebhookSenderTest, AJobThatGoesOnBeforeItsEndIsToldTellsOfItsNextEnd) {
  WebhookSender sender = Sender();
  const std::string id = StartedJob();
  ASSERT_TRUE(jobs_.Cancel(id).ok());
  ASSERT_TRUE(jobs_.Resume(id).ok());
  EXPECT_EQ(*sender.SendDue(), 0);
  ASSERT_TRUE(jobs_.Cancel(id).ok());
  EXPECT_EQ(*sender.SendDue(), 1);
  ASSERT_TRUE(jobs_.Delete(id).ok());
  EXPECT_EQ(*sender.SendDue(), 0);
}

TEST_F(WebhookSenderTest, HostsThatAServerDoesNotAllowWaitForOneThatDoes) {
  WebhookSender sender = Sender("elsewhere.example"), updated = Sender();
  const std::string id = StartedJob();
  ASSERT_TRUE(jobs_.Cancel(id).ok());
  EXPECT_EQ(*sender.SendDue(), 1);
  EXPECT_TRUE(sent_.empty());
  Webhook webhook = *WebhookOf(*jobs_.Get(id));
  EXPECT_EQ(webhook.attempts, 1);
  EXPECT_THAT(webhook.last_error, HasSubstr("elsewhere.example only, not to example.com"));
  MakeDue(id);
  EXPECT_EQ(*updated.SendDue(), 1);
  EXPECT_EQ(sent_.size(), 1u);
  EXPECT_GT(WebhookOf(*jobs_.Get(id))->delivered_event, 0);
}

TEST_F(WebhookSenderTest, AnEndThatNobodyMayBeToldIsGivenUpAfterADayOfAttempts) {
  WebhookSender sender = Sender("elsewhere.example");
  const std::string id = StartedJob();
  ASSERT_TRUE(jobs_.Cancel(id).ok());
  int attempts = 0;
  for (; jobs_.Get(id)->webhook_due_ms > 0; ++attempts) {
    ASSERT_LT(attempts, 100);
    if (attempts > 0) MakeDue(id);
    EXPECT_EQ(*sender.SendDue(), 1);
  }
  EXPECT_EQ(attempts, 30);
  EXPECT_TRUE(sent_.empty());
}

TEST_F(WebhookSenderTest, ReceiversThatHangLeaveAThreadToOtherClients) {
  for (int i = 0; i < 8; ++i) EndJobOf("alice");
  std::atomic<int> hanging = 0;
  std::promise<void> bob_told, end;
  WebhookSender sender(
      store_.get(), {{"*"}}, Body,
      [&, ended = end.get_future().share()](const std::string&, const std::string& body,
                                            const auto&) {
        if (body.find("bob") != std::string::npos) {
          bob_told.set_value();
        } else {
          ++hanging;
          ended.wait();
        }
        return absl::OkStatus();
      },
      /*threads=*/4);
  while (hanging < 3) std::this_thread::yield();
  EndJobOf("bob");
  EXPECT_EQ(bob_told.get_future().wait_for(std::chrono::seconds(60)), std::future_status::ready);
  EXPECT_EQ(hanging, 3);
  end.set_value();
}

}  // namespace
}  // namespace litags
