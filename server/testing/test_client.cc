#include "server/testing/test_client.h"

#include <grpcpp/client_context.h>
#include <gtest/gtest.h>

#include <chrono>
#include <thread>

#include "absl/strings/escaping.h"
#include "server/store/digest.h"
#include "server/testing/photos.h"

namespace litags {
namespace {

using SystemClock = std::chrono::system_clock;

struct Call : grpc::ClientContext {
  Call() { set_deadline(SystemClock::now() + std::chrono::seconds(30)); }
};

template <typename Request>
Request Named(const std::string& name) {
  Request request;
  request.set_name(name);
  return request;
}

bool IsEnd(v1::JobState state) {
  return state == v1::JOB_STATE_SUCCEEDED || state == v1::JOB_STATE_FAILED ||
         state == v1::JOB_STATE_CANCELLED;
}

}  // namespace

ErrorDetail DetailOf(const grpc::Status& status) {
  v1::RpcStatus rpc;
  v1::ErrorDetail detail;
  if (!rpc.ParseFromString(status.error_details()) || rpc.details_size() < 2 ||
      rpc.code() != status.error_code() || rpc.message() != status.error_message() ||
      !rpc.details(0).UnpackTo(&detail)) {
    return {};
  }
  return {detail.reason(), detail.field()};
}

TestClient::TestClient(const std::shared_ptr<grpc::Channel>& channel)
    : jobs(v1::ReconstructionService::NewStub(channel)),
      render(v1::RenderService::NewStub(channel)),
      model(v1::ModelService::NewStub(channel)) {}

grpc::Status TestClient::Create(const v1::CreateJobRequest& request, v1::Job* job) {
  Call call;
  return jobs->CreateJob(&call, request, job);
}

v1::UploadImagesRequest NameMessage(const std::string& name) {
  v1::UploadImagesRequest message;
  message.set_name(name);
  return message;
}

v1::UploadImagesRequest EndMessage(int files) {
  v1::UploadImagesRequest message;
  message.mutable_end()->set_files(files);
  return message;
}

std::vector<v1::UploadImagesRequest> FileMessages(const TestFile& file, std::string sha256,
                                                  int64_t size) {
  std::vector<v1::UploadImagesRequest> messages(1);
  v1::FileHeader* header = messages[0].mutable_file();
  header->set_file_name(file.name);
  header->set_role(file.role);
  header->set_size_bytes(size < 0 ? static_cast<int64_t>(file.bytes.size()) : size);
  header->set_sha256(sha256.empty() ? absl::HexStringToBytes(Sha256::Hex(file.bytes)) : sha256);
  constexpr size_t kChunk = 1000;  // small, so that files have several
  for (size_t i = 0; i < file.bytes.size(); i += kChunk) {
    messages.emplace_back().set_chunk(file.bytes.substr(i, kChunk));
  }
  return messages;
}

grpc::Status TestClient::Query(const std::string& name, const std::vector<TestFile>& files,
                               v1::QueryUploadResponse* response) {
  Call call;
  auto request = Named<v1::QueryUploadRequest>(name);
  for (const TestFile& file : files) *request.add_files() = FileMessages(file)[0].file();
  return jobs->QueryUpload(&call, request, response);
}

grpc::Status TestClient::UploadRaw(const std::vector<v1::UploadImagesRequest>& messages) {
  Call call;
  v1::UploadImagesResponse response;
  const auto writer = jobs->UploadImages(&call, &response);
  for (const auto& message : messages) {
    if (!writer->Write(message)) break;  // refused; Finish() says why
  }
  writer->WritesDone();
  return writer->Finish();
}

grpc::Status TestClient::Upload(const std::string& name, const std::vector<TestFile>& files,
                                v1::UploadImagesResponse* response) {
  Call call;
  v1::UploadImagesResponse unused;
  const auto writer = jobs->UploadImages(&call, response ? response : &unused);
  bool open = writer->Write(NameMessage(name));
  for (const TestFile& file : files) {
    for (const auto& message : FileMessages(file)) open = open && writer->Write(message);
  }
  writer->Write(EndMessage(static_cast<int>(files.size())));
  writer->WritesDone();
  return writer->Finish();
}

grpc::Status TestClient::Start(const std::string& name, v1::Job* job) {
  Call call;
  v1::Job unused;
  return jobs->StartJob(&call, Named<v1::StartJobRequest>(name), job ? job : &unused);
}

grpc::Status TestClient::Get(const std::string& name, v1::Job* job) {
  Call call;
  return jobs->GetJob(&call, Named<v1::GetJobRequest>(name), job);
}

grpc::Status TestClient::Cancel(const std::string& name) {
  Call call;
  v1::Job unused;
  return jobs->CancelJob(&call, Named<v1::CancelJobRequest>(name), &unused);
}

grpc::Status TestClient::Resume(const std::string& name, v1::Job* job) {
  return Resume(Named<v1::ResumeJobRequest>(name), job);
}

grpc::Status TestClient::Resume(const v1::ResumeJobRequest& request, v1::Job* job) {
  Call call;
  v1::Job unused;
  return jobs->ResumeJob(&call, request, job ? job : &unused);
}

grpc::Status TestClient::Delete(const std::string& name) {
  Call call;
  google::protobuf::Empty unused;
  return jobs->DeleteJob(&call, Named<v1::DeleteJobRequest>(name), &unused);
}

grpc::Status TestClient::Watch(const std::string& name, int64_t after,
                               std::vector<v1::JobEvent>* events, size_t at_most, bool previews) {
  Call call;
  auto request = Named<v1::WatchJobRequest>(name);
  request.set_after_event(after);
  request.set_include_previews(previews);
  const auto reader = jobs->WatchJob(&call, request);
  v1::JobEvent event;
  for (size_t i = 0; i < at_most && reader->Read(&event); ++i) events->push_back(event);
  if (events->size() >= at_most) call.TryCancel();
  while (reader->Read(&event)) {
  }
  return reader->Finish();
}

std::string TestClient::History(const std::string& name) {
  std::vector<v1::JobEvent> events;
  const grpc::Status status = Watch(name, 0, &events);
  EXPECT_TRUE(status.ok()) << status.error_message();
  std::string history;
  for (size_t i = 0; i < events.size(); ++i) {
    EXPECT_EQ(events[i].number(), static_cast<int64_t>(i + 1));
    if (!events[i].has_state_change()) continue;
    history += v1::JobState_Name(events[i].state_change().state()).substr(10) + " ";
  }
  return history;
}

grpc::Status TestClient::Render(const v1::RenderViewRequest& request, v1::RenderedView* view) {
  Call call;
  return render->RenderView(&call, request, view);
}

std::string TestClient::StartedJob(const std::vector<std::string>& stems, int iterations) {
  v1::CreateJobRequest request;
  request.mutable_options()->set_iterations(iterations);
  request.mutable_options()->set_preview_every(10);
  request.mutable_options()->set_checkpoint_every(10);
  v1::Job job;
  EXPECT_TRUE(Create(request, &job).ok());
  std::vector<TestFile> files;
  for (size_t i = 0; i < stems.size(); ++i) {
    files.push_back({stems[i] + ".png", TestPng(64, 48, static_cast<int>(i))});
  }
  const grpc::Status uploaded = Upload(job.name(), files);
  EXPECT_TRUE(uploaded.ok()) << uploaded.error_message();
  const grpc::Status started = Start(job.name());
  EXPECT_TRUE(started.ok()) << started.error_message();
  return job.name();
}

v1::Job TestClient::WaitFor(const std::string& name, v1::JobState state, double seconds) {
  const auto deadline = SystemClock::now() + std::chrono::duration<double>(seconds);
  v1::Job job;
  do {
    const grpc::Status status = Get(name, &job);
    EXPECT_TRUE(status.ok()) << status.error_message();
    if (!status.ok() || job.state() == state || IsEnd(job.state())) break;
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  } while (SystemClock::now() < deadline);
  EXPECT_EQ(job.state(), state) << job.ShortDebugString();
  return job;
}

}  // namespace litags
