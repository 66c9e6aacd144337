// Lists that nobody reads, held back as only a client can that is written for it.
#include <grpcpp/create_channel.h>
#include <gtest/gtest.h>

#include <chrono>

#include "absl/strings/str_cat.h"
#include "server/testing/api_fixture.h"
#include "server/testing/eventually.h"

namespace litags {
namespace {

// Jobs of 8 KB each, and room for 2 MB of answers, of which one client may have half.
class UnreadLists : public ApiTest {
 protected:
  static constexpr int kJobs = 100;

  void SetUp() override {
    litags::NewJob job;
    for (int i = 0; i < 64; ++i) {
      const std::string key = absl::StrCat("k", i);
      job.labels[key + std::string(63 - key.size(), 'k')] = std::string(63, 'v');
    }
    for (int i = 0; i < kJobs; ++i) job_ = absl::StrCat("jobs/", jobs_.Create(job)->id);
    ServerOptions options = Options();
    options.listen = "127.0.0.1:0";
    options.answers.max_unread_bytes = 2'000'000;
    server_ = *StartServer(options, &jobs_, engine_.get());
    const std::string address = absl::StrCat("127.0.0.1:", server_->port());
    client_ = TestClient(grpc::CreateChannel(address, grpc::InsecureChannelCredentials()));
    grpc::ChannelArguments arguments;  // gRPC takes in some MB by itself, unless told not to
    arguments.SetInt(GRPC_ARG_HTTP2_BDP_PROBE, 0);
    arguments.SetInt(GRPC_ARG_HTTP2_STREAM_LOOKAHEAD_BYTES, 64 << 10);
    slow_channel_ =
        grpc::CreateCustomChannel(address, grpc::InsecureChannelCredentials(), arguments);
    list_.set_page_size(kJobs);
  }

  template <typename Stub, typename Request, typename Response>
  std::string Refusal(Stub& stub,
                      grpc::Status (Stub::*method)(grpc::ClientContext*, const Request&, Response*),
                      const Request& request) {
    grpc::ClientContext call;
    call.set_deadline(std::chrono::system_clock::now() + std::chrono::seconds(60));
    Response response;
    return DetailOf((stub.*method)(&call, request, &response)).reason;
  }

  std::string ListJobsRefusal() {
    return Refusal(*client_.jobs, &v1::ReconstructionService::Stub::ListJobs, list_);
  }

  std::string job_;
  v1::ListJobsRequest list_;
  std::shared_ptr<grpc::Channel> slow_channel_;
};

TEST_F(UnreadLists, FillTheRoomOfTheirClientUntilTheirCallsEnd) {
  grpc::ClientContext call;
  const grpc::internal::RpcMethod method("/litags.v1.ReconstructionService/ListJobs",
                                         grpc::internal::RpcMethod::SERVER_STREAMING);
  const std::unique_ptr<grpc::ClientReader<v1::ListJobsResponse>> reader(
      grpc::internal::ClientReaderFactory<v1::ListJobsResponse>::Create(slow_channel_.get(), method,
                                                                        &call, list_));
  reader->WaitForInitialMetadata();
  EXPECT_TRUE(Eventually([&] { return ListJobsRefusal() == "RENDER_QUEUE_FULL"; }));
  v1::ListFilesRequest files;
  files.set_name(job_);
  EXPECT_EQ(Refusal(*client_.jobs, &v1::ReconstructionService::Stub::ListFiles, files),
            "RENDER_QUEUE_FULL");
  v1::ListCamerasRequest cameras;
  cameras.set_name(job_);
  EXPECT_EQ(Refusal(*client_.render, &v1::RenderService::Stub::ListCameras, cameras),
            "RENDER_QUEUE_FULL");
  call.TryCancel();
  EXPECT_FALSE(reader->Finish().ok());
  EXPECT_TRUE(Eventually([&] {
    return Refusal(*client_.render, &v1::RenderService::Stub::ListCameras, cameras) ==
           "SCENE_NOT_READY";
  }));
}

}  // namespace
}  // namespace litags
