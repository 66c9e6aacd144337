// Services of our own making, for the client library to call: one job, and connections that break.
#ifndef LITAGS_CLIENT_CLIENT_TEST_UTIL_H_
#define LITAGS_CLIENT_CLIENT_TEST_UTIL_H_

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <map>
#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "absl/strings/str_cat.h"
#include "client/client.h"
#include "client/interrupt.h"
#include "grpcpp/server.h"
#include "grpcpp/server_builder.h"
#include "grpcpp/server_context.h"
#include "litags/v1/errors.pb.h"
#include "litags/v1/model_service.grpc.pb.h"
#include "litags/v1/reconstruction_service.grpc.pb.h"
#include "litags/v1/render_service.grpc.pb.h"

namespace litags::client {

inline grpc::Status Broken() { return {grpc::UNAVAILABLE, "Socket closed"}; }

inline grpc::Status Refusal(grpc::StatusCode code, const std::string& reason,
                            const std::string& field) {
  v1::ErrorDetail detail;
  detail.set_reason(reason);
  detail.set_field(field);
  v1::RpcStatus status;
  status.set_code(code);
  status.add_details()->PackFrom(detail);
  return {code, "refused", status.SerializeAsString()};
}

// Keeps one job. Connections break where the test wants it.
class FakeReconstruction : public v1::ReconstructionService::Service {
 public:
  struct State {
    std::map<std::string, std::string> stored;  // name to bytes
    std::string refused;                        // name of a file
    std::set<std::string> announced;            // names
    std::vector<std::string> request_ids;
    std::string start_request_id;
    int breaks_left = 0;     // streams (and StartJob answers) to break
    size_t break_after = 2;  // files or events
    int64_t events = 10;
    int64_t skipped_event = 0;  // left out of the watch
    int starts = 0, streams = 0, deletes = 0;
    std::chrono::milliseconds held{0};  // before a watch breaks
    bool hang = false;                  // WatchJob waits for its end
  };

  // Calls come on threads of the server: the state is locked as long as what this returns lives.
  class Locked {
   public:
    explicit Locked(FakeReconstruction* fake) : lock_(fake->mutex_), state_(&fake->state_) {}
    State* operator->() const { return state_; }

   private:
    std::unique_lock<std::mutex> lock_;
    State* state_;
  };
  Locked state() { return Locked(this); }

  grpc::Status CreateJob(grpc::ServerContext*, const v1::CreateJobRequest* request,
                         v1::Job* job) override {
    const Locked now = state();
    now->request_ids.push_back(request->request_id());
    if (now->breaks_left > 0 && now->request_ids.size() > 1) {
      --now->breaks_left;
      return Broken();
    }
    job->set_name("jobs/1");
    return grpc::Status::OK;
  }

  grpc::Status QueryUpload(grpc::ServerContext*, const v1::QueryUploadRequest* request,
                           v1::QueryUploadResponse* response) override {
    const Locked now = state();
    for (const v1::FileHeader& file : request->files()) {
      if (file.file_name().find('\n') != std::string::npos) {
        return Refused("BAD_FILE_NAME", absl::StrCat("images[", file.file_name(), "]"));
      }
      v1::FileStatus* status = response->add_files();
      const auto it = now->stored.find(file.file_name());
      if (it == now->stored.end()) continue;
      status->set_offset(static_cast<int64_t>(it->second.size()));
      status->set_stored(status->offset() == file.size_bytes());
    }
    return grpc::Status::OK;
  }

  grpc::Status UploadImages(grpc::ServerContext*,
                            grpc::ServerReader<v1::UploadImagesRequest>* reader,
                            v1::UploadImagesResponse* response) override {
    const Locked now = state();
    ++now->streams;
    v1::UploadImagesRequest request;
    if (!reader->Read(&request) || request.name() != "jobs/1") return Refused("UPLOAD_ORDER", "");
    v1::FileHeader header;
    size_t files = 0;
    int received = 0, announced = -1;
    while (reader->Read(&request)) {
      if (request.has_end()) {
        announced = request.end().files();
        continue;
      }
      if (request.has_file()) {
        header = request.file();
        now->announced.insert(header.file_name());
        if (header.file_name() == now->refused) return Refused("MODEL_CORRUPT", "colmap");
        if (header.file_name() == "bad.jpg") return Refused("IMAGE_UNSUPPORTED", "images[bad.jpg]");
        if (now->breaks_left > 0 && files++ == now->break_after) {
          --now->breaks_left;
          return Broken();
        }
        received += header.file_name() != "lost.jpg";
        now->stored[header.file_name()].resize(static_cast<size_t>(header.offset()));
      } else {
        now->stored[header.file_name()] += request.chunk();
      }
    }
    if (announced < 0) return Refused("UPLOAD_INCOMPLETE", "end.files");
    response->set_files_received(received);
    return grpc::Status::OK;
  }

  grpc::Status DeleteFile(grpc::ServerContext*, const v1::DeleteFileRequest* request,
                          google::protobuf::Empty*) override {
    return state()->stored.erase(request->file_name()) > 0 || request->allow_missing()
               ? grpc::Status::OK
               : Refusal(grpc::NOT_FOUND, "JOB_FILE_NOT_FOUND", "file_name");
  }

  grpc::Status StartJob(grpc::ServerContext*, const v1::StartJobRequest* request,
                        v1::Job* job) override {
    const Locked now = state();
    if (++now->starts > 1 && request->request_id() != now->start_request_id) {
      return Refusal(grpc::FAILED_PRECONDITION, "JOB_NOT_UPLOADING", "name");
    }
    now->start_request_id = request->request_id();
    if (now->breaks_left > 0) {
      --now->breaks_left;
      return Broken();  // started, but nobody hears of it
    }
    job->set_name("jobs/1");
    return grpc::Status::OK;
  }

  grpc::Status GetJob(grpc::ServerContext*, const v1::GetJobRequest* request,
                      v1::Job* job) override {
    if (request->name() != "jobs/1") {
      return Refusal(grpc::NOT_FOUND, "JOB_NOT_FOUND", "name");
    }
    job->set_name("jobs/1");
    job->set_state(v1::JOB_STATE_SUCCEEDED);
    return grpc::Status::OK;
  }

  // Of a job that is gone, perhaps by a try before.
  grpc::Status DeleteJob(grpc::ServerContext*, const v1::DeleteJobRequest* request,
                         google::protobuf::Empty*) override {
    const Locked now = state();
    ++now->deletes;
    if (now->breaks_left > 0) {
      --now->breaks_left;
      return Broken();
    }
    return request->allow_missing() ? grpc::Status::OK
                                    : Refusal(grpc::NOT_FOUND, "JOB_NOT_FOUND", "name");
  }

  grpc::Status GetLog(grpc::ServerContext*, const v1::GetLogRequest* request,
                      grpc::ServerWriter<v1::LogEntry>* writer) override {
    const Locked now = state();
    return Send(now, request->after_entry(), writer);
  }

  grpc::Status WatchJob(grpc::ServerContext* context, const v1::WatchJobRequest* request,
                        grpc::ServerWriter<v1::JobEvent>* writer) override {
    const Locked now = state();
    const grpc::Status sent = Send(now, request->after_event(), writer);
    if (!sent.ok()) return sent;
    while (now->hang && !context->IsCancelled()) {
      std::this_thread::sleep_for(std::chrono::milliseconds(2));
    }
    return grpc::Status::OK;
  }

 private:
  // The records after that one, but for those that the test wants lost.
  template <typename Record>
  static grpc::Status Send(const Locked& now, int64_t after, grpc::ServerWriter<Record>* writer) {
    ++now->streams;
    size_t sent = 0;
    for (int64_t number = after + 1; number <= now->events; ++number) {
      if (number == now->skipped_event) continue;
      if (now->breaks_left > 0 && sent++ == now->break_after) {
        --now->breaks_left;
        std::this_thread::sleep_for(now->held);
        return Broken();
      }
      Record record;
      record.set_number(number);
      writer->Write(record);
    }
    return grpc::Status::OK;
  }

  static grpc::Status Refused(const std::string& reason, const std::string& field) {
    return Refusal(grpc::INVALID_ARGUMENT, reason, field);
  }

  std::mutex mutex_;
  State state_;
};

// Three frames without a picture.
class FakeRender : public v1::RenderService::Service {
 public:
  std::atomic<int> calls = 0;
  std::atomic<int> lost_frame = -1;  // is not sent
  std::atomic<bool> breaks = false;  // behind the frames
  grpc::Status RenderPath(grpc::ServerContext*, const v1::RenderPathRequest*,
                          grpc::ServerWriter<v1::RenderPathResponse>* writer) override {
    ++calls;
    v1::RenderPathResponse response;
    response.set_frames(3);
    for (int frame = 0; frame < 3; ++frame) {
      response.set_frame(frame);
      if (frame != lost_frame) writer->Write(response);
    }
    return breaks ? Broken() : grpc::Status::OK;
  }
};

class FakeModel : public v1::ModelService::Service {
 public:
  std::atomic<int> calls = 0;
  std::atomic<int64_t> announced = 5;
  std::atomic<bool> breaks = false;  // always, in the middle
  grpc::Status ExportModel(grpc::ServerContext*, const v1::ExportModelRequest*,
                           grpc::ServerWriter<v1::ExportModelResponse>* writer) override {
    ++calls;
    v1::ExportModelResponse response;
    response.mutable_header()->set_size_bytes(announced);
    writer->Write(response);
    response.set_chunk("abc");
    writer->Write(response);
    if (breaks) return Broken();
    response.set_chunk("de");
    writer->Write(response);
    return grpc::Status::OK;
  }
};

// A folder of the test.
class FolderTest : public ::testing::Test {
 protected:
  FolderTest()
      : dir_(std::filesystem::temp_directory_path() / absl::StrCat("litags-client-", RandomId())) {
    std::filesystem::create_directories(dir_);
  }
  ~FolderTest() override { std::filesystem::remove_all(dir_); }

  void Write(const std::string& name, const std::string& content) {
    std::filesystem::create_directories((dir_ / name).parent_path());
    std::ofstream(dir_ / name, std::ios::binary) << content;
  }

  const std::filesystem::path dir_;
};

// The services above, and a client of them that soon tries again.
class ClientTest : public FolderTest {
 protected:
  ClientTest() {
    grpc::ServerBuilder builder;
    builder.RegisterService(&service_);
    builder.RegisterService(&model_);
    builder.RegisterService(&render_);
    builder.AddListeningPort("127.0.0.1:0", grpc::InsecureServerCredentials(), &port_);
    server_ = builder.BuildAndStart();
    ClientOptions options;
    options.first_pause_seconds = 0.001;
    options.max_pause_seconds = 0.002;
    options.retry_seconds = 2;
    client_ = std::make_unique<Client>(server_->InProcessChannel({}), options, interrupt_);
  }
  ~ClientTest() override { server_->Shutdown(); }

  FakeReconstruction service_;
  FakeModel model_;
  FakeRender render_;
  int port_ = 0;
  std::unique_ptr<grpc::Server> server_;
  Interrupt interrupt_;
  std::unique_ptr<Client> client_;
};

}  // namespace litags::client

#endif  // LITAGS_CLIENT_CLIENT_TEST_UTIL_H_
