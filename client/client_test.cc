// The client library against services of our own making, in this process.
#include "client/client.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <future>
#include <limits>
#include <thread>
#include <vector>

#include "absl/strings/str_cat.h"
#include "client/client_test_util.h"
#include "client/connection.h"
#include "client/status.h"
#include "grpcpp/server.h"
#include "grpcpp/server_builder.h"

namespace litags::client {
namespace {

using ::testing::ElementsAre;

// The numbers of the events after that one.
std::vector<int64_t> Watch(Client& client, int64_t after, absl::Status* status) {
  std::vector<int64_t> numbers;
  *status = client
                .WatchJob("jobs/1", after,
                          [&](const v1::JobEvent& event) { numbers.push_back(event.number()); })
                .status();
  return numbers;
}

TEST_F(ClientTest, AnErrorCarriesTheDetailOfTheService) {
  const auto job = client_->GetJob("jobs/other");
  EXPECT_EQ(job.status().code(), absl::StatusCode::kNotFound);
  EXPECT_EQ(DetailOf(job.status()).reason(), "JOB_NOT_FOUND");
  EXPECT_EQ(DetailOf(job.status()).field(), "name");
}

TEST_F(ClientTest, WatchingOverABreakingConnectionLosesAndDoublesNothing) {
  service_.state()->breaks_left = 3;
  absl::Status status;
  EXPECT_THAT(Watch(*client_, 0, &status), ElementsAre(1, 2, 3, 4, 5, 6, 7, 8, 9, 10));
  EXPECT_TRUE(status.ok()) << status;
  EXPECT_EQ(service_.state()->streams, 4);
}

TEST_F(ClientTest, WatchingStartsAfterAGivenEvent) {
  absl::Status status;
  EXPECT_THAT(Watch(*client_, 7, &status), ElementsAre(8, 9, 10));
  EXPECT_TRUE(status.ok()) << status;
}

TEST_F(ClientTest, EventsUpToANumberDoNotWaitForTheEndOfTheJob) {
  service_.state()->breaks_left = 1;
  service_.state()->hang = true;
  std::vector<int64_t> numbers;
  const auto add = [&](const v1::JobEvent& event) { numbers.push_back(event.number()); };
  ASSERT_TRUE(client_->ListEvents("jobs/1", 5, add).ok());
  EXPECT_THAT(numbers, ElementsAre(1, 2, 3, 4, 5));
  ASSERT_TRUE(client_->ListEvents("jobs/1", 0, add).ok());
  EXPECT_EQ(numbers.size(), 5u);
}

TEST_F(ClientTest, AGapInTheEventsIsAnError) {
  service_.state()->skipped_event = 4;
  absl::Status status;
  EXPECT_THAT(Watch(*client_, 0, &status), ElementsAre(1, 2, 3));
  EXPECT_EQ(DetailOf(status).reason(), "EVENTS_BROKEN");
}

TEST_F(ClientTest, ALogOverABreakingConnectionLosesAndDoublesNothing) {
  service_.state()->breaks_left = 3;
  std::vector<int64_t> numbers;
  const auto read = [&](const v1::LogEntry& entry) { numbers.push_back(entry.number()); };
  const absl::Status status = client_->GetLog("jobs/1", 4, /*follow=*/true, read);
  EXPECT_TRUE(status.ok()) << status;
  EXPECT_THAT(numbers, ElementsAre(5, 6, 7, 8, 9, 10));
  service_.state()->skipped_event = 4;
  EXPECT_EQ(DetailOf(client_->GetLog("jobs/1", 0, true, read)).reason(), "LOG_BROKEN");
}

TEST_F(ClientTest, ARetriedCreationKeepsItsRequestId) {
  ASSERT_TRUE(client_->CreateJob({}).ok());
  service_.state()->breaks_left = 1;
  ASSERT_TRUE(client_->CreateJob({}).ok());
  const std::vector<std::string> ids = service_.state()->request_ids;
  ASSERT_EQ(ids.size(), 3u);
  EXPECT_EQ(ids[1], ids[2]);
  EXPECT_NE(ids[0], ids[1]);
  EXPECT_FALSE(ids[0].empty());
}

TEST_F(ClientTest, AStartWhoseAnswerWasLostCountsAsStarted) {
  ASSERT_TRUE(client_->GetJob("jobs/1").ok());
  service_.state()->breaks_left = 1;
  const auto job = client_->StartJob("jobs/1");
  EXPECT_TRUE(job.ok()) << job.status();
  EXPECT_EQ(service_.state()->starts, 2);
}

TEST_F(ClientTest, ASecondStartByTheUserIsAnError) {
  ASSERT_TRUE(client_->StartJob("jobs/1").ok());
  EXPECT_EQ(DetailOf(client_->StartJob("jobs/1").status()).reason(), "JOB_NOT_UPLOADING");
}

TEST_F(ClientTest, AServerThatStartsAtThatMomentIsWaitedFor) {
  ClientOptions options;
  options.first_pause_seconds = options.max_pause_seconds = 0.01;
  options.on_retry = [](const absl::Status&, double) { FAIL() << "nothing was lost"; };
  Client client(server_->InProcessChannel({}), options, interrupt_);
  int tries = 0;
  EXPECT_TRUE(client
                  .Retry([&](bool*) {
                    return ++tries < 3 ? absl::UnavailableError("refused") : absl::OkStatus();
                  })
                  .ok());
  options.start_seconds = 0;
  Client hasty(server_->InProcessChannel({}), options, interrupt_);
  tries = 0;
  EXPECT_TRUE(absl::IsUnavailable(hasty.Retry([&](bool*) {
    ++tries;
    return absl::UnavailableError("refused");
  })));
  EXPECT_EQ(tries, 1);
}

TEST_F(ClientTest, WhatTheServiceSaysToTryAgainIsTriedAgainWhateverItsReason) {
  const grpc::Status refusal = Refusal(grpc::RESOURCE_EXHAUSTED, "NEW_LIMIT_REACHED", "");
  EXPECT_FALSE(MayBeTriedAgain(FromGrpc(refusal)));
  v1::RpcStatus details;
  ASSERT_TRUE(details.ParseFromString(refusal.error_details()));
  details.add_details()->set_type_url("type.googleapis.com/google.rpc.RetryInfo");
  const absl::Status busy = FromGrpc({grpc::RESOURCE_EXHAUSTED, "", details.SerializeAsString()});
  EXPECT_TRUE(MayBeTriedAgain(busy));
  EXPECT_EQ(DetailOf(busy).reason(), "NEW_LIMIT_REACHED");
}

TEST_F(ClientTest, ABrokenConnectionIsGivenUpInTheEnd) {
  ASSERT_TRUE(client_->GetJob("jobs/1").ok());
  ClientOptions options;
  options.first_pause_seconds = options.max_pause_seconds = 0.01;
  options.retry_seconds = 1;
  Client client(server_->InProcessChannel({}), options, interrupt_);
  ASSERT_TRUE(client.GetJob("jobs/1").ok());
  int tries = 0;
  const absl::Status status = client.Retry([&](bool*) {
    ++tries;
    return absl::UnavailableError("gone");
  });
  EXPECT_TRUE(absl::IsUnavailable(status));
  EXPECT_GE(tries, 3);
}

TEST_F(ClientTest, AWatchThatHeldIsTriedAnewForAllOfTheTime) {
  ClientOptions options;
  options.first_pause_seconds = options.max_pause_seconds = 0.01;
  options.retry_seconds = 0.1;
  options.held_seconds = 0.15;
  Client client(server_->InProcessChannel({}), options, interrupt_);
  service_.state()->held = std::chrono::milliseconds(200);
  service_.state()->break_after = 0;
  service_.state()->breaks_left = 3;
  const absl::Status status = client.WatchJob("jobs/1", 0, [](const v1::JobEvent&) {}).status();
  EXPECT_TRUE(status.ok()) << status;
  EXPECT_EQ(service_.state()->streams, 4);
}

TEST_F(ClientTest, ACallOfOneAnswerThatHeldIsGivenUpInTheEnd) {
  ClientOptions options;
  options.first_pause_seconds = options.max_pause_seconds = 0.01;
  options.retry_seconds = 0.2;
  options.held_seconds = 0;
  Client client(server_->InProcessChannel({}), options, interrupt_);
  ASSERT_TRUE(client.GetJob("jobs/1").ok());
  service_.state()->breaks_left = 1000;
  EXPECT_TRUE(absl::IsUnavailable(client.DeleteJob("jobs/1")));
  EXPECT_GT(service_.state()->breaks_left, 0);
}

TEST_F(ClientTest, ADeletionWhoseAnswerWasLostIsOne) {
  ASSERT_TRUE(client_->GetJob("jobs/1").ok());
  EXPECT_TRUE(absl::IsNotFound(client_->DeleteJob("jobs/1")));
  service_.state()->breaks_left = 1;
  EXPECT_TRUE(client_->DeleteJob("jobs/1").ok());
  EXPECT_EQ(service_.state()->deletes, 3);
}

TEST_F(ClientTest, ADeletionThatNeverArrivedIsNone) {
  const std::string address = absl::StrCat("127.0.0.1:", port_);
  const auto channel = Connect({.server = address});
  ASSERT_TRUE(channel.ok()) << channel.status();
  std::unique_ptr<grpc::Server> later;
  ClientOptions options;
  options.on_retry = [&](const absl::Status&, double) {
    if (later != nullptr) return;
    grpc::ServerBuilder builder;
    builder.RegisterService(&service_);
    builder.AddListeningPort(address, grpc::InsecureServerCredentials());
    later = builder.BuildAndStart();
  };
  Client client(*channel, options, interrupt_);
  ASSERT_TRUE(client.GetJob("jobs/1").ok());
  server_->Shutdown();
  // Until the channel knows that its connection is gone.
  (*channel)->WaitForStateChange(GRPC_CHANNEL_READY,
                                 std::chrono::system_clock::now() + std::chrono::seconds(20));
  EXPECT_TRUE(absl::IsNotFound(client.DeleteJob("jobs/typo")));
  EXPECT_EQ(service_.state()->deletes, 1);
}

TEST_F(ClientTest, AServerThatNeverAnsweredIsReportedSoon) {
  const auto channel = Connect({.server = "127.0.0.1:1"});
  ASSERT_TRUE(channel.ok());
  Client client(*channel, {}, interrupt_);  // retries for two minutes otherwise
  const auto begin = std::chrono::steady_clock::now();
  EXPECT_TRUE(absl::IsUnavailable(client.GetJob("jobs/1").status()));
  EXPECT_LT(std::chrono::steady_clock::now() - begin, std::chrono::seconds(20));
}

TEST_F(ClientTest, OneServerOfSeveralIsEnough) {
  for (int i = 0; i < 8; ++i) {  // in whichever order they are tried
    const auto channel =
        Connect({.server = absl::StrCat("127.0.0.1:1,127.0.0.1:", port_, ",127.0.0.1:2")});
    ASSERT_TRUE(channel.ok()) << channel.status();
    EXPECT_TRUE(Client(*channel, {}, interrupt_).GetJob("jobs/1").ok());
  }
}

TEST_F(ClientTest, AnInterruptEndsAWatch) {
  service_.state()->hang = true;
  std::promise<void> all;
  std::thread interrupter([&] {
    all.get_future().wait();
    interrupt_.Raise();
  });
  int events = 0;
  const absl::Status status = client_
                                  ->WatchJob("jobs/1", 0,
                                             [&](const v1::JobEvent&) {
                                               if (++events == 10) all.set_value();
                                             })
                                  .status();
  interrupter.join();
  EXPECT_EQ(events, 10);
  EXPECT_TRUE(absl::IsCancelled(status)) << status;
}

TEST_F(ClientTest, APathWithoutAllOfItsFramesIsAnError) {
  const auto reason = [&](int lost_frame, bool breaks) {
    render_.lost_frame = lost_frame;
    render_.breaks = breaks;
    const auto take = [](const v1::RenderPathResponse&) { return absl::OkStatus(); };
    return DetailOf(client_->RenderPath({}, take)).reason();
  };
  EXPECT_EQ(reason(-1, false), "");
  EXPECT_EQ(reason(1, false), "FRAMES_BROKEN");
  EXPECT_EQ(reason(2, false), "FRAMES_BROKEN");
  EXPECT_EQ(reason(2, true), "PATH_INTERRUPTED");
}

TEST_F(ClientTest, AnExportIsPassedOnInOrder) {
  std::string bytes;
  int64_t announced = 0;
  const absl::Status status = client_->ExportModel(
      {},
      [&](const v1::ExportHeader& header) {
        announced = header.size_bytes();
        return absl::OkStatus();
      },
      [&](std::string_view chunk) {
        bytes += chunk;
        return absl::OkStatus();
      });
  EXPECT_TRUE(status.ok()) << status;
  EXPECT_EQ(bytes, "abcde");
  EXPECT_EQ(announced, 5);
}

TEST_F(ClientTest, AnExportOfTheWrongLengthIsAnError) {
  model_.announced = 6;
  const absl::Status status = client_->ExportModel(
      {}, [](const v1::ExportHeader&) { return absl::OkStatus(); },
      [](std::string_view) { return absl::OkStatus(); });
  EXPECT_EQ(DetailOf(status).reason(), "EXPORT_BROKEN");
}

TEST_F(ClientTest, AnExportThatAlwaysBreaksIsGivenUpInTheEnd) {
  ClientOptions options;
  options.first_pause_seconds = options.max_pause_seconds = 0.01;
  options.retry_seconds = 0.2;
  Client client(server_->InProcessChannel({}), options, interrupt_);
  model_.breaks = true;
  int tries = 0;
  const absl::Status status = client.ExportModel(
      {},
      [&](const v1::ExportHeader&) {
        return ++tries < 1000 ? absl::OkStatus() : absl::InternalError("tried for ever");
      },
      [](std::string_view) { return absl::OkStatus(); });
  EXPECT_TRUE(absl::IsUnavailable(status)) << status;
  EXPECT_GT(tries, 1);
}

TEST_F(ClientTest, AnErrorOfTheReceiverEndsAnExport) {
  const absl::Status status = client_->ExportModel(
      {}, [](const v1::ExportHeader&) { return absl::ResourceExhaustedError("disk full"); },
      [](std::string_view) { return absl::OkStatus(); });
  EXPECT_EQ(status.message(), "disk full");
}

// Whatever the code: it is no broken connection's.
TEST_F(ClientTest, ACallIsNotMadeAgainForAnErrorOfTheReceiver) {
  for (const absl::Status& mine : {absl::CancelledError("enough"), absl::UnavailableError("enough"),
                                   absl::DeadlineExceededError("enough")}) {
    model_.calls = render_.calls = 0;
    EXPECT_EQ(client_->ExportModel(
                  {}, [](const v1::ExportHeader&) { return absl::OkStatus(); },
                  [&](std::string_view) { return mine; }),
              mine);
    EXPECT_EQ(client_->ExportModel(
                  {}, [&](const v1::ExportHeader&) { return mine; },
                  [](std::string_view) { return absl::OkStatus(); }),
              mine);
    EXPECT_EQ(model_.calls, 2);
    EXPECT_EQ(client_->RenderPath({}, [&](const v1::RenderPathResponse&) { return mine; }), mine);
    EXPECT_EQ(render_.calls, 1);
  }
}

TEST_F(ClientTest, CallsMayHaveAllTheTimeThatThereIs) {
  ClientOptions options;
  for (const double seconds : {1.74e10, std::numeric_limits<double>::infinity()}) {
    options.call_seconds = seconds;
    EXPECT_TRUE(Client(server_->InProcessChannel({}), options, interrupt_).GetJob("jobs/1").ok());
  }
}

TEST(JobName, TakesBothForms) {
  EXPECT_EQ(JobName("12"), "jobs/12");
  EXPECT_EQ(JobName("jobs/12"), "jobs/12");
}

}  // namespace
}  // namespace litags::client
