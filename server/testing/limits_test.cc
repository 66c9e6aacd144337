// What one client may have and take, over real sockets.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <set>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "engine/io/file_util.h"
#include "server/jobs/jobs_test_util.h"
#include "server/jobs/leases.h"
#include "server/testing/access_fixture.h"
#include "server/testing/eventually.h"
#include "server/testing/photos.h"

namespace litags {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;

class Limits : public AccessTest {};

TEST_F(Limits, StreamsOfOneClientAreCounted) {
  options_.limits.max_streams = 2;
  Start();
  const std::string hers = Created("alice"), his = Created("bob");
  std::vector<std::unique_ptr<ClientCall>> calls;
  std::vector<std::unique_ptr<grpc::ClientReader<v1::JobEvent>>> open;
  v1::JobEvent event;
  for (int i = 0; i < 2; ++i) {
    calls.push_back(std::make_unique<ClientCall>(tokens_.at("alice")));
    open.push_back(stubs_->jobs->WatchJob(calls.back().get(), Named<v1::WatchJobRequest>(hers)));
    ASSERT_TRUE(open.back()->Read(&event));
  }
  const auto watch = [&](const std::string& client, const std::string& job) {
    ClientCall call(tokens_.at(client));
    return FirstOf(call, stubs_->jobs->WatchJob(&call, Named<v1::WatchJobRequest>(job)));
  };
  const grpc::Status third = watch("alice", hers);
  EXPECT_EQ(third.error_code(), grpc::RESOURCE_EXHAUSTED);
  EXPECT_EQ(DetailOf(third).reason, "TOO_MANY_STREAMS");
  EXPECT_THAT(third.error_message(), HasSubstr("has 2 uploads, watches, paths and exports open"));
  EXPECT_TRUE(watch("bob", his).ok());
  calls[0]->TryCancel();
  open[0]->Finish();
  // The server learns of it a moment later.
  grpc::Status again;
  for (int i = 0; i < 200 && !(again = watch("alice", hers)).ok(); ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  EXPECT_TRUE(again.ok()) << again.error_message();
  calls[1]->TryCancel();
  open[1]->Finish();
}

TEST_F(Limits, AStreamThatHasEndedMakesRoomAtOnce) {
  options_.limits.max_streams = 1;
  Start();
  const std::string job = Created("alice");
  {
    ClientCall call(tokens_.at("alice"));
    v1::Job cancelled;
    ASSERT_TRUE(stubs_->jobs->CancelJob(&call, Named<v1::CancelJobRequest>(job), &cancelled).ok());
  }
  for (int i = 0; i < 100; ++i) {
    ClientCall call(tokens_.at("alice"));
    const auto watch = stubs_->jobs->WatchJob(&call, Named<v1::WatchJobRequest>(job));
    v1::JobEvent event;
    while (watch->Read(&event)) {
    }
    const grpc::Status status = watch->Finish();
    ASSERT_TRUE(status.ok()) << i << ": " << status.error_message();
  }
}

TEST_F(Limits, TooManyOpenCallsAreTriedAgainByClientsWithOurServiceConfig) {
  options_.connections.counts.calls.of_client = 1;
  Start();
  grpc::ChannelArguments trying_again;
  trying_again.SetServiceConfigJSON(
      *ReadFile(LITAGS_SOURCE_DIR "/proto/litags/v1/service_config.json", "", 1 << 20));
  const Stubs patient(Connect("", trying_again));
  const std::string job = Created("alice");
  ClientCall watching(tokens_.at("alice")), once(tokens_.at("alice")), again(tokens_.at("alice"));
  const auto watch = patient.jobs->WatchJob(&watching, Named<v1::WatchJobRequest>(job));
  v1::JobEvent event;
  ASSERT_TRUE(watch->Read(&event));
  v1::Job found;
  grpc::Status got;
  grpc::CompletionQueue queue;
  const auto repeated = patient.jobs->AsyncGetJob(&again, Named<v1::GetJobRequest>(job), &queue);
  repeated->Finish(&found, &got, nullptr);
  // Comes after the other's first try, and is not repeated.
  google::protobuf::Empty empty;
  const grpc::Status refused =
      patient.jobs->DeleteJob(&once, Named<v1::DeleteJobRequest>(job), &empty);
  EXPECT_EQ(refused.error_code(), grpc::UNAVAILABLE);
  EXPECT_THAT(refused.error_message(), HasSubstr("too many calls are open"));
  watching.TryCancel();
  watch->Finish();
  void* tag = nullptr;
  bool done = false;
  EXPECT_TRUE(queue.Next(&tag, &done));
  EXPECT_TRUE(got.ok()) << got.error_message();
}

TEST_F(Limits, ConnectionsOfOneClientAreCounted) {
  options_.connections.counts.max_connections = 8;  // a client may have two
  Start();
  const auto bobs = Connect();
  std::vector<std::shared_ptr<grpc::Channel>> hers;
  const auto call = [&](const std::string& client, const std::shared_ptr<grpc::Channel>& channel) {
    ClientCall call(tokens_.at(client));
    v1::ServerInfo info;
    EXPECT_TRUE(Stubs(channel).jobs->GetServerInfo(&call, {}, &info).ok());
  };
  const auto is_open = [](const std::shared_ptr<grpc::Channel>& channel) {
    return channel->GetState(/*try_to_connect=*/false) == GRPC_CHANNEL_READY;
  };
  call("bob", bobs);
  for (int i = 0; i < 3; ++i) call("alice", hers.emplace_back(Connect()));
  EXPECT_TRUE(Eventually([&] { return std::ranges::count_if(hers, is_open) == 2; }));
  EXPECT_TRUE(is_open(hers[2]));
  EXPECT_TRUE(is_open(bobs));
}

TEST_F(Limits, PicturesOfOneClientAreCountedPerSecond) {
  options_.limits.pictures_per_second = 5;
  options_.limits.picture_burst = 3;
  Start();
  const auto render = [&](const std::string& client, const std::string& job) {
    ClientCall call(tokens_.at(client));
    v1::RenderedView view;
    return DetailOf(stubs_->render->RenderView(&call, Named<v1::RenderViewRequest>(job), &view))
        .reason;
  };
  const std::string hers = Created("alice"), his = Created("bob");
  std::vector<std::string> reasons;
  for (int i = 0; i < 20; ++i) reasons.push_back(render("alice", hers));
  // No scene yet, which is an answer, for the first three; one every 200 ms comes free.
  EXPECT_EQ(std::set<std::string>(reasons.begin(), reasons.begin() + 3),
            std::set<std::string>{"SCENE_NOT_READY"});
  EXPECT_THAT(reasons, Contains("PICTURE_RATE_EXCEEDED"));
  EXPECT_EQ(render("bob", his), "SCENE_NOT_READY");
  std::this_thread::sleep_for(std::chrono::milliseconds(300));
  EXPECT_EQ(render("alice", hers), "SCENE_NOT_READY");
}

TEST_F(Limits, JobsOfOneClientAreCounted) {
  options_.limits.max_jobs = 2;
  Start();
  Created("alice");
  Created("alice");
  Created("bob");
  ClientCall call(tokens_.at("alice"));
  v1::Job job;
  const grpc::Status third = stubs_->jobs->CreateJob(&call, {}, &job);
  EXPECT_EQ(third.error_code(), grpc::RESOURCE_EXHAUSTED);
  EXPECT_EQ(DetailOf(third).reason, "JOB_QUOTA_REACHED");
}

TEST_F(Limits, BytesOfOneClientAreCountedBeforeTheyAreComplete) {
  const std::string photo = TestPng(64, 48, 1), other = TestPng(64, 48, 2);
  options_.limits.max_bytes = static_cast<int64_t>(photo.size() + other.size() / 2);
  Start();
  const auto upload = [&](const std::string& client, const std::string& job,
                          const std::string& bytes, bool whole) {
    ClientCall call(tokens_.at(client));
    v1::UploadImagesResponse response;
    auto writer = stubs_->jobs->UploadImages(&call, &response);
    writer->Write(NameMessage(job));
    auto messages = FileMessages({"x.png", bytes});
    if (!whole) messages.back().mutable_chunk()->pop_back();
    for (const auto& message : messages) writer->Write(message);
    writer->Write(EndMessage(1));
    writer->WritesDone();
    return DetailOf(writer->Finish());
  };
  const std::string hers = Created("alice"), also_hers = Created("alice"), his = Created("bob");
  EXPECT_EQ(upload("alice", hers, photo, /*whole=*/false).reason, "FILE_TRUNCATED");
  const ErrorDetail refused = upload("alice", also_hers, other, true);
  EXPECT_EQ(refused.reason, "BYTE_QUOTA_REACHED");
  EXPECT_EQ(refused.field, "images[x.png]");
  EXPECT_EQ(upload("bob", his, other, true).reason, "");
}

TEST_F(Limits, OversizedMessagesAndHeadersAreRefused) {
  Start();
  Created("alice");  // a newcomer is cut off before it has sent so much
  v1::CreateJobRequest request;
  request.set_display_name(std::string(3 << 20, 'x'));
  v1::Job job;
  ClientCall large(tokens_.at("alice"));
  EXPECT_EQ(stubs_->jobs->CreateJob(&large, request, &job).error_code(), grpc::RESOURCE_EXHAUSTED);
  ClientCall headers(tokens_.at("alice"));
  headers.AddMetadata("x-large", std::string(100 << 10, 'x'));
  const Stubs closed(Connect());  // the server may end the connection for it
  EXPECT_FALSE(closed.jobs->CreateJob(&headers, {}, &job).ok());
  Created("alice");  // and the server lives on
}

class JobCapsOfClients : public Limits {
 protected:
  ErrorDetail Create(const std::string& client, const v1::CreateJobRequest& request) {
    ClientCall call(tokens_.at(client));
    v1::Job job;
    return DetailOf(stubs_->jobs->CreateJob(&call, request, &job));
  }
  static void ExpectCap(const ErrorDetail& refused, const std::string& field) {
    EXPECT_EQ(refused.reason, "JOB_CAP_EXCEEDED");
    EXPECT_EQ(refused.field, field);
  }
  // A job of alice with enough photos, made while there were no caps.
  std::string OldJob(const ReconstructOptions& options) {
    const auto alice = jobs_.For({.owner = "alice"});
    NewJob wanted;
    wanted.options = options;
    return "jobs/" + UploadedJob(*alice, data_, wanted);
  }
};

TEST_F(JobCapsOfClients, AreAppliedWhenAJobIsMadeAndNotToAdministrators) {
  options_.limits.caps.max_memory_bytes = int64_t{1} << 30;
  Start();
  const int64_t two_gib = int64_t{2} << 30;
  std::vector<std::pair<std::string, v1::CreateJobRequest>> refused(6);
  refused[0].first = "options.iterations";
  refused[0].second.mutable_options()->set_iterations(100'001);
  refused[1].first = "options.max_gaussians";
  refused[1].second.mutable_options()->set_max_gaussians(2'000'001);
  refused[2].first = "policy.max_run_time";
  refused[2].second.mutable_policy()->mutable_max_run_time()->set_seconds(86'401);
  refused[3].first = "policy.priority";
  refused[3].second.mutable_policy()->set_priority(1);
  refused[4].first = "policy.max_memory_bytes";
  refused[4].second.mutable_policy()->set_max_memory_bytes(two_gib);
  refused[5].first = "policy.min_memory_bytes";
  refused[5].second.mutable_policy()->set_min_memory_bytes(two_gib);
  for (const auto& [field, request] : refused) {
    ExpectCap(Create("alice", request), field);
    EXPECT_EQ(Create("root", request).reason, "");
  }
  v1::CreateJobRequest most;
  most.mutable_options()->set_iterations(100'000);
  most.mutable_options()->set_max_gaussians(2'000'000);
  most.mutable_policy()->mutable_max_run_time()->set_seconds(86'400);
  EXPECT_EQ(Create("alice", most).reason, "");
}

TEST_F(JobCapsOfClients, AreAppliedAgainWhenAJobIsStartedAndLimitItsRun) {
  Start();
  ReconstructOptions options;
  ClientCall first(tokens_.at("alice")), second(tokens_.at("alice"));
  v1::Job job;
  const auto start = [&](ClientCall* call, const std::string& name) {
    return DetailOf(stubs_->jobs->StartJob(call, Named<v1::StartJobRequest>(name), &job));
  };
  EXPECT_EQ(start(&first, OldJob(options)).reason, "");
  EXPECT_EQ(job.policy().max_run_time().seconds(), 86'400);
  options.iterations = 200'000;
  ExpectCap(start(&second, OldJob(options)), "options.iterations");
}

TEST_F(JobCapsOfClients, ResultsCountAsBytesOfTheClient) {
  options_.limits.max_bytes = 1000;
  Start();
  const std::string old = OldJob({}), next = OldJob({});
  const auto start = [&](const std::string& name) {
    ClientCall call(tokens_.at("alice"));
    v1::Job job;
    return DetailOf(stubs_->jobs->StartJob(&call, Named<v1::StartJobRequest>(name), &job)).reason;
  };
  EXPECT_EQ(start(old), "");
  Leases leases(store_.get(), blobs_.get());
  const Lease lease = **leases.Acquire("worker");
  ASSERT_TRUE(leases.Succeed(lease, {}, {{kSceneFile, {"1/aa", 2000}}}).ok());
  EXPECT_EQ(start(next), "BYTE_QUOTA_REACHED");
  ClientCall call(tokens_.at("alice"));
  google::protobuf::Empty empty;
  ASSERT_TRUE(stubs_->jobs->DeleteJob(&call, Named<v1::DeleteJobRequest>(old), &empty).ok());
  EXPECT_EQ(start(next), "");
}

}  // namespace
}  // namespace litags
