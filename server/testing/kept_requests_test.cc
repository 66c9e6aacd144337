// What the server keeps of requests while their calls are open.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <malloc.h>

#include <atomic>
#include <chrono>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "absl/strings/str_cat.h"
#include "server/testing/access_fixture.h"
#include "server/testing/eventually.h"
#include "server/testing/slow_client_fixture.h"

namespace litags {
namespace {

using ::testing::HasSubstr;

constexpr int kNoField = 1000;  // of no message

// Some 3 bytes each on the wire, and 16 in memory.
void AddUnknownNumbers(google::protobuf::Message* message, int count) {
  auto* const unknown = message->GetReflection()->MutableUnknownFields(message);
  for (int i = 0; i < count; ++i) unknown->AddVarint(kNoField, 1);
}

void AddUnknownText(google::protobuf::Message* message, size_t bytes) {
  message->GetReflection()->MutableUnknownFields(message)->AddLengthDelimited(
      kNoField, std::string(bytes, 'x'));
}

class KeptRequests : public AccessTest {
 protected:
  static constexpr size_t kLarge = 100 << 10;

  grpc::Status Get(const std::string& client, const v1::GetJobRequest& request) {
    ClientCall call(tokens_.at(client));
    v1::Job job;
    return stubs_->jobs->GetJob(&call, request, &job);
  }
  grpc::Status GetLarge(const std::string& client, const std::string& job) {
    auto request = Named<v1::GetJobRequest>(job);
    AddUnknownText(&request, kLarge);
    return Get(client, request);
  }

  // Opens a watch with a large request, which stays; false: it was refused.
  bool WatchLarge(const std::string& client, const std::string& job) {
    auto request = Named<v1::WatchJobRequest>(job);
    AddUnknownText(&request, kLarge);
    calls_.push_back(std::make_unique<ClientCall>(tokens_.at(client)));
    watches_.push_back(stubs_->jobs->WatchJob(calls_.back().get(), request));
    v1::JobEvent event;
    if (watches_.back()->Read(&event)) return true;
    refusal_ = DetailOf(watches_.back()->Finish()).reason;
    watches_.pop_back();
    calls_.pop_back();
    return false;
  }
  void EndWatch() {
    calls_.back()->TryCancel();
    watches_.back()->Finish();
    watches_.pop_back();
    calls_.pop_back();
  }

  std::string refusal_;
  std::vector<std::unique_ptr<ClientCall>> calls_;
  std::vector<std::unique_ptr<grpc::ClientReader<v1::JobEvent>>> watches_;
};

TEST_F(KeptRequests, OneThatIsTooLargeInMemoryIsRefused) {
  Start();
  const std::string job = Created("alice");
  auto get = Named<v1::GetJobRequest>(job);
  AddUnknownNumbers(&get, 1000);
  EXPECT_EQ(DetailOf(Get("alice", get)).reason, "");
  AddUnknownNumbers(&get, 500'000);
  const grpc::Status refused = Get("alice", get);
  EXPECT_EQ(refused.error_code(), grpc::INVALID_ARGUMENT);
  EXPECT_EQ(DetailOf(refused).reason, "TOO_MANY_IN_CALL");
  EXPECT_THAT(refused.error_message(), HasSubstr("KiB of memory, and may take 4096"));
  // Deep inside, and of a stream.
  v1::RenderPathRequest path;
  AddUnknownNumbers(path.mutable_keyframes()->add_poses()->mutable_viewmat(), 500'000);
  ClientCall call(tokens_.at("alice"));
  EXPECT_EQ(DetailOf(FirstOf(call, stubs_->render->RenderPath(&call, path))).reason,
            "TOO_MANY_IN_CALL");
}

TEST_F(KeptRequests, ThePathThroughMostPosesIsLetIn) {
  Start();
  auto path = Named<v1::RenderPathRequest>(Created("alice"));
  for (int i = 0; i < 10'000; ++i) {
    v1::LookAt* look = path.mutable_keyframes()->add_poses()->mutable_look_at();
    for (auto* v : {look->mutable_eye(), look->mutable_target(), look->mutable_up()}) {
      v->set_x(i);
      v->set_y(1);
      v->set_z(1);
    }
  }
  ClientCall call(tokens_.at("alice"));
  EXPECT_EQ(DetailOf(FirstOf(call, stubs_->render->RenderPath(&call, path))).reason,
            "SCENE_NOT_READY");
}

TEST_F(KeptRequests, OfOpenCallsHaveARoomOfWhichOneClientHasHalf) {
  options_.requests.max_kept_bytes = 10 * kLarge;
  Start();
  const std::string hers = Created("alice"), his = Created("bob");
  int open = 0;
  while (open < 10 && WatchLarge("alice", hers)) ++open;
  EXPECT_EQ(open, 5);
  EXPECT_EQ(refusal_, "SERVER_BUSY");
  EXPECT_EQ(DetailOf(GetLarge("alice", hers)).reason, "SERVER_BUSY");
  EXPECT_TRUE(Get("alice", Named<v1::GetJobRequest>(hers)).ok());
  EXPECT_TRUE(GetLarge("bob", his).ok());
  EndWatch();  // the server learns of it a moment later
  EXPECT_TRUE(Eventually([&] { return GetLarge("alice", hers).ok(); }));
  EXPECT_TRUE(WatchLarge("bob", his));
  while (!watches_.empty()) EndWatch();
}

TEST_F(KeptRequests, OneThatIsRefusedIsEmptied) {
  const auto authenticator = Authenticator::Make({});
  ASSERT_TRUE(authenticator.ok());
  Metrics metrics;
  Connections connections({});
  Gate gate(&jobs_, authenticator->get(), &metrics, &connections, {}, {}, {}, 60);
  grpc::CallbackServerContext context;
  v1::BatchDeleteJobsRequest request;
  for (int i = 0; i < 10'000; ++i) request.add_names();
  gate.Refuse(context, {"BatchDeleteJobs", CallKind::kChange}, &request,
              absl::ResourceExhaustedError("no room"));
  EXPECT_LT(request.SpaceUsedLong(), 1000u);
}

class KeptByStreams : public SlowClientTest {
 protected:
  // Of this process, server and clients.
  static int64_t BytesInUse() {
    const auto info = mallinfo2();
    return static_cast<int64_t>(info.uordblks + info.hblkhd);
  }

  grpc::ClientContext* NewCall() {
    calls_.push_back(std::make_unique<grpc::ClientContext>());
    calls_.back()->set_deadline(std::chrono::system_clock::now() + std::chrono::seconds(30));
    return calls_.back().get();
  }
  void CancelAll() {
    for (const auto& call : calls_) call->TryCancel();
  }

  std::vector<std::unique_ptr<grpc::ClientContext>> calls_;
};

TEST_F(KeptByStreams, CamerasOfPathsTakeTheRoomOfRequests) {
  const std::string job = FinishedJob();
  ServerOptions options = Options();
  options.requests.max_kept_bytes = 5'000'000;
  Serve(options, engine_.get());
  const auto open = [&](int frames) {
    auto path = OpenPath(NewCall(), job, frames);
    v1::RenderPathResponse frame;
    return path->Read(&frame) ? std::move(path) : nullptr;
  };
  const PathReader first = open(10'000), second = open(10'000);
  ASSERT_TRUE(first && second);
  grpc::ClientContext call;
  const PathReader third = OpenPath(&call, job, 10'000);
  v1::RenderPathResponse frame;
  EXPECT_FALSE(third->Read(&frame));
  EXPECT_EQ(DetailOf(third->Finish()).reason, "SERVER_BUSY");
  const PathReader small = open(10);
  ASSERT_TRUE(small);
  CancelAll();
  for (const auto& path : {&first, &second, &small}) (*path)->Finish();
  PathReader again;
  EXPECT_TRUE(Eventually([&] { return (again = open(10'000)) != nullptr; }));
  CancelAll();
  if (again) again->Finish();
}

TEST_F(KeptByStreams, OfARequestThereIsOneCopy) {
  constexpr int kStreams = 16, kBytes = 1 << 20;
  v1::WatchJobRequest request;
  request.set_name(NewJob());
  AddUnknownText(&request, kBytes);
  const int64_t before = BytesInUse();
  std::vector<std::unique_ptr<grpc::ClientReader<v1::JobEvent>>> watches;
  v1::JobEvent event;
  for (int i = 0; i < kStreams; ++i) {
    watches.push_back(client_.jobs->WatchJob(NewCall(), request));
    ASSERT_TRUE(watches.back()->Read(&event));
  }
  EXPECT_LT(BytesInUse() - before, kStreams * kBytes * 3 / 2);
  CancelAll();
  for (const auto& watch : watches) watch->Finish();
}

TEST_F(KeptByStreams, AnUploadThatIsSilentHoldsNoMessage) {
  constexpr int kStreams = 32, kBytes = 1 << 20;
  const std::string job = NewJob();
  std::vector<TestFile> files;
  for (int i = 0; i < kStreams; ++i) {
    files.push_back({absl::StrCat(i, ".png"), std::string(kBytes + 1, static_cast<char>(i))});
  }
  const int64_t before = BytesInUse();
  std::vector<std::unique_ptr<grpc::ClientWriter<v1::UploadImagesRequest>>> uploads;
  v1::UploadImagesResponse response;
  for (const TestFile& file : files) {
    uploads.push_back(client_.jobs->UploadImages(NewCall(), &response));
    uploads.back()->Write(NameMessage(job));
    uploads.back()->Write(FileMessages(file)[0]);
    v1::UploadImagesRequest chunk;
    chunk.set_chunk(file.bytes.substr(0, kBytes));
    ASSERT_TRUE(uploads.back()->Write(chunk));
  }
  EXPECT_TRUE(Eventually([&] {
    v1::QueryUploadResponse stored;
    EXPECT_TRUE(client_.Query(job, files, &stored).ok());
    for (const auto& status : stored.files()) {
      if (status.offset() != kBytes) return false;
    }
    return true;
  }));
  EXPECT_TRUE(Eventually([&] { return BytesInUse() - before < kStreams * kBytes / 2; }));
  CancelAll();
  for (const auto& upload : uploads) upload->Finish();
}

// As long as they wait for their client's share of the processor.
TEST_F(KeptByStreams, MessagesOfUploadsCountUntilTheyAreTaken) {
  ServerOptions options = Options();
  options.upload_cpu = {.per_second = 1e-6, .burst_seconds = 0};
  options.connections.counts.calls.unfinished_bytes = 8 << 20;
  Serve(options, engine_.get());
  constexpr int kStreams = 16;
  v1::UploadImagesRequest message;
  message.set_chunk(std::string(1 << 20, 'x'));
  std::vector<std::unique_ptr<grpc::ClientWriter<v1::UploadImagesRequest>>> uploads;
  v1::UploadImagesResponse response;
  for (int i = 0; i < kStreams; ++i) {
    uploads.push_back(client_.jobs->UploadImages(NewCall(), &response));
    uploads.back()->Write(message);
  }
  std::atomic<int> cut = 0;
  std::vector<std::thread> ends;
  for (const auto& upload : uploads) {
    ends.emplace_back([&] { cut += upload->Finish().error_code() == grpc::UNAVAILABLE; });
  }
  EXPECT_TRUE(Eventually([&] { return cut > 0; }));
  CancelAll();  // what the client sent on its next connection may have room
  for (std::thread& end : ends) end.join();
}

}  // namespace
}  // namespace litags
