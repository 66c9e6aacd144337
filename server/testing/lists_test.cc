// Lists of many entries: in pages that every client takes, and where nobody reads them, held back
// as only a client can that is written for it.
#include <grpcpp/create_channel.h>
#include <gtest/gtest.h>

#include <chrono>
#include <set>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "server/api/convert.h"
#include "server/jobs/codec.h"
#include "server/testing/api_fixture.h"
#include "server/testing/eventually.h"

namespace litags {
namespace {

// A job of 8 KB.
litags::NewJob WithManyLabels() {
  litags::NewJob job;
  for (int i = 0; i < 64; ++i) {
    const std::string key = absl::StrCat("k", i);
    job.labels[key + std::string(63 - key.size(), 'k')] = std::string(63, 'v');
  }
  return job;
}

using ListPages = ApiTest;

TEST_F(ListPages, APageOfManyLabelsIsOneThatClientsTake) {
  const litags::NewJob job = WithManyLabels();
  constexpr size_t kJobs = 600;
  std::set<std::string> made, listed;
  for (size_t i = 0; i < kJobs; ++i) {
    made.insert(absl::StrCat("jobs/", jobs_.Create(job)->id));
  }
  v1::ListJobsRequest request;
  request.set_page_size(1000);
  size_t bytes = 0;
  do {
    v1::ListJobsResponse page;
    grpc::ClientContext call;
    const grpc::Status status = client_.jobs->ListJobs(&call, request, &page);
    ASSERT_TRUE(status.ok()) << status.error_message();
    for (const v1::Job& one : page.jobs()) EXPECT_TRUE(listed.insert(one.name()).second);
    EXPECT_LT(page.ByteSizeLong(), 2'200'000u);
    bytes += page.ByteSizeLong();
    request.set_page_token(page.next_page_token());
  } while (!request.page_token().empty());
  EXPECT_EQ(listed, made);
  EXPECT_GT(bytes, 4u << 20);  // or one page would do
}

TEST_F(ListPages, AReportNamesAThousandPhotosAndNotesAtMost) {
  JobRecord job = *jobs_.Create(litags::NewJob());
  ReconstructReport report;
  report.dropped.assign(1500, std::string(255, 'x'));
  report.notes.assign(1500, std::string(300, 'y'));
  job.report = Encode(report);
  const auto proto = JobToProto(job);
  ASSERT_TRUE(proto.ok()) << proto.status();
  EXPECT_EQ(proto->report().dropped_size(), 1000);
  EXPECT_EQ(proto->report().notes_size(), 1000);
  EXPECT_LT(proto->ByteSizeLong(), 1u << 20);
}

TEST_F(ListPages, APageOfManyFilesIsOneThatClientsTake) {
  const std::string id = jobs_.Create(litags::NewJob())->id;
  constexpr size_t kFiles = 9000;
  const auto add = [](JobTransaction& transaction) -> absl::Status {
    for (size_t i = 0; i < kFiles; ++i) {
      const std::string number = absl::StrCat(i);
      LITAGS_RETURN_IF_ERROR(
          transaction.PutFile({number + std::string(240 - number.size(), 'x') + ".png",
                               FileRole::kPhoto, 5, std::string(64, 'a'), 64, 48}));
    }
    return absl::OkStatus();
  };
  ASSERT_TRUE(store_->Update(id, add).ok());
  v1::ListFilesRequest request;
  request.set_name(absl::StrCat("jobs/", id));
  request.set_page_size(10000);
  std::set<std::string> listed;
  size_t bytes = 0;
  do {
    v1::ListFilesResponse page;
    grpc::ClientContext call;
    const grpc::Status status = client_.jobs->ListFiles(&call, request, &page);
    ASSERT_TRUE(status.ok()) << status.error_message();
    for (const v1::JobFile& file : page.files())
      EXPECT_TRUE(listed.insert(file.file_name()).second);
    EXPECT_LT(page.ByteSizeLong(), 2'200'000u);
    bytes += page.ByteSizeLong();
    request.set_page_token(page.next_page_token());
  } while (!request.page_token().empty());
  EXPECT_EQ(listed.size(), kFiles);
  EXPECT_GT(bytes, 2'200'000u);
}

// Jobs of 8 KB each, and room for 2 MB of answers, of which one client may have half.
class UnreadLists : public ApiTest {
 protected:
  static constexpr int kJobs = 100;

  void SetUp() override {
    const litags::NewJob job = WithManyLabels();
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
