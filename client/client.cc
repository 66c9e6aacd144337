#include "client/client.h"

#include <openssl/rand.h>

#include <algorithm>
#include <chrono>
#include <random>
#include <vector>

#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "client/report/report.h"
#include "client/report/text.h"
#include "client/status.h"
#include "grpcpp/generic/generic_stub.h"

namespace litags::client {
namespace {

using Clock = std::chrono::steady_clock;

// Whether the status was made by a server and not by the lack of one.
bool IsAnswer(const absl::Status& status) {
  return (status.code() != absl::StatusCode::kUnavailable &&
          status.code() != absl::StatusCode::kDeadlineExceeded) ||
         !DetailOf(status).reason().empty();
}

double Seconds(Clock::duration duration) { return std::chrono::duration<double>(duration).count(); }

// Of any number of seconds, also of infinitely many.
std::chrono::system_clock::time_point After(double seconds) {
  constexpr double kYear = 365 * 86400.0;
  const double wait = seconds < kYear ? std::max(seconds, 0.0) : kYear;
  return std::chrono::system_clock::now() + std::chrono::milliseconds(int64_t(1000 * wait));
}

double RandomFactor() {
  thread_local std::minstd_rand generator(std::random_device{}());
  return std::uniform_real_distribution<double>(0.8, 1.2)(generator);
}

// Of Follow(): to the end of the stream.
constexpr int64_t kNoLast = 0;

}  // namespace

bool MayBeTriedAgain(const absl::Status& status) {
  const std::string reason = DetailOf(status).reason();
  return absl::IsUnavailable(status) || absl::IsCancelled(status) || HasRetryInfo(status) ||
         (absl::IsDeadlineExceeded(status) && reason.empty()) ||
         // What came is kept, and another stream sends the rest.
         reason == "UPLOAD_STALLED" || reason == "OFFSET_INVALID";
}

std::string JobName(std::string_view job) {
  return job.starts_with("jobs/") ? std::string(job) : "jobs/" + std::string(job);
}

std::string RandomId() {
  unsigned char bits[16];
  if (RAND_bytes(bits, sizeof(bits)) != 1) {
    std::random_device device;
    for (unsigned char& byte : bits) byte = static_cast<unsigned char>(device());
  }
  return absl::BytesToHexString({reinterpret_cast<const char*>(bits), sizeof(bits)});
}

Client::Client(std::shared_ptr<grpc::Channel> channel, ClientOptions options, Interrupt& interrupt)
    : channel_(std::move(channel)),
      options_(std::move(options)),
      interrupt_(interrupt),
      reconstruction_(v1::ReconstructionService::NewStub(channel_)),
      render_(v1::RenderService::NewStub(channel_)),
      model_(v1::ModelService::NewStub(channel_)) {}

bool Client::Wait(double seconds) {
  constexpr double kStep = 0.05;
  const Clock::time_point begin = Clock::now();
  for (double left = seconds; left > 0; left = seconds - Seconds(Clock::now() - begin)) {
    if (!interrupt_.Sleep(std::chrono::milliseconds(int64_t(1000 * std::min(kStep, left))))) {
      return false;
    }
    // gRPC connects only while somebody asks the channel; by itself it looks every 5 seconds.
    const grpc_connectivity_state state = channel_->GetState(/*try_to_connect=*/true);
    if (state == GRPC_CHANNEL_READY || state == GRPC_CHANNEL_SHUTDOWN) continue;
    if (channel_->WaitForConnected(std::chrono::system_clock::now() +
                                   std::chrono::milliseconds(10))) {
      return true;
    }
  }
  return true;
}

bool Client::MayHaveArrived() const {
  return channel_->GetState(/*try_to_connect=*/false) != GRPC_CHANNEL_TRANSIENT_FAILURE;
}

absl::Status Client::Retry(absl::FunctionRef<absl::Status(bool* progressed)> attempt) {
  Clock::time_point good = Clock::now();
  double pause = options_.first_pause_seconds;
  while (true) {
    bool progressed = false;
    const absl::Status status = attempt(&progressed);
    if (progressed || IsAnswer(status)) answered_ = true;
    if (status.ok()) return status;
    if (interrupt_.raised()) return absl::CancelledError("interrupted");
    if (progressed) {
      good = Clock::now();
      pause = options_.first_pause_seconds;
    }
    if (!MayBeTriedAgain(status)) return status;
    const bool was_there = answered_;
    const double limit = was_there ? options_.retry_seconds
                                   : std::min(options_.retry_seconds, options_.start_seconds);
    if (Seconds(Clock::now() - good) + pause > limit) return status;
    const double this_pause = pause * RandomFactor();
    if (was_there && options_.on_retry) options_.on_retry(status, this_pause);
    if (!Wait(this_pause)) return absl::CancelledError("interrupted");
    pause = std::min(2 * pause, options_.max_pause_seconds);
  }
}

template <class Response, class Call>
absl::StatusOr<Response> Client::Unary(Call call) {
  Response response;
  const absl::Status status = Retry([&](bool*) {
    grpc::ClientContext context;
    context.set_deadline(After(options_.call_seconds));
    Interrupt::Scope scope(interrupt_, context);
    return FromGrpc(call(&context, &response));
  });
  if (!status.ok()) return status;
  return response;
}

template <class Stub, class Request, class Response>
absl::StatusOr<Response> Client::Unary(Stub& stub,
                                       grpc::Status (Stub::*method)(grpc::ClientContext*,
                                                                    const Request&, Response*),
                                       const Request& request) {
  return Unary<Response>([&](grpc::ClientContext* context, Response* response) {
    return (stub.*method)(context, request, response);
  });
}

absl::StatusOr<v1::Job> Client::CreateJob(v1::CreateJobRequest request) {
  if (request.request_id().empty()) request.set_request_id(RandomId());
  return Unary(*reconstruction_, &v1::ReconstructionService::Stub::CreateJob, request);
}

absl::StatusOr<v1::Job> Client::CloneJob(v1::CloneJobRequest request) {
  if (request.request_id().empty()) request.set_request_id(RandomId());
  return Unary(*reconstruction_, &v1::ReconstructionService::Stub::CloneJob, request);
}

absl::StatusOr<v1::Job> Client::StartJob(const std::string& name) {
  v1::StartJobRequest request;
  request.set_name(name);
  request.set_request_id(RandomId());
  return Unary(*reconstruction_, &v1::ReconstructionService::Stub::StartJob, request);
}

absl::StatusOr<v1::Job> Client::GetJob(const std::string& name) {
  v1::GetJobRequest request;
  request.set_name(name);
  return Unary(*reconstruction_, &v1::ReconstructionService::Stub::GetJob, request);
}

absl::StatusOr<v1::ListJobsResponse> Client::ListJobs(const v1::ListJobsRequest& request) {
  return Unary(*reconstruction_, &v1::ReconstructionService::Stub::ListJobs, request);
}

absl::StatusOr<v1::Job> Client::CancelJob(const std::string& name) {
  v1::CancelJobRequest request;
  request.set_name(name);
  return Unary(*reconstruction_, &v1::ReconstructionService::Stub::CancelJob, request);
}

absl::StatusOr<v1::Job> Client::ResumeJob(v1::ResumeJobRequest request) {
  if (request.request_id().empty()) request.set_request_id(RandomId());
  return Unary(*reconstruction_, &v1::ReconstructionService::Stub::ResumeJob, request);
}

absl::StatusOr<v1::Job> Client::UpdateJob(const v1::UpdateJobRequest& request) {
  return Unary(*reconstruction_, &v1::ReconstructionService::Stub::UpdateJob, request);
}

absl::Status Client::DeleteFile(const v1::DeleteFileRequest& request) {
  return Unary(*reconstruction_, &v1::ReconstructionService::Stub::DeleteFile, request).status();
}

absl::StatusOr<v1::ListFilesResponse> Client::ListFiles(const v1::ListFilesRequest& request) {
  return Unary(*reconstruction_, &v1::ReconstructionService::Stub::ListFiles, request);
}

absl::StatusOr<v1::ServerInfo> Client::GetServerInfo() {
  return Unary(*reconstruction_, &v1::ReconstructionService::Stub::GetServerInfo,
               v1::GetServerInfoRequest());
}

absl::Status Client::DeleteJob(const std::string& name) {
  v1::DeleteJobRequest request;
  request.set_name(name);
  bool arrived = false;  // an earlier try, perhaps: its answer may have been lost
  return Unary<google::protobuf::Empty>([&](grpc::ClientContext* context, auto* response) {
           const grpc::Status status = reconstruction_->DeleteJob(context, request, response);
           if (arrived && status.error_code() == grpc::NOT_FOUND) return grpc::Status::OK;
           arrived |= MayHaveArrived();
           return status;
         })
      .status();
}

template <class Record, class Open>
absl::Status Client::Follow(Open open, const char* what, const char* reason, int64_t* after,
                            int64_t last, absl::FunctionRef<void(const Record&)> on_record) {
  return Retry([&](bool* progressed) {
    grpc::ClientContext context;
    Interrupt::Scope scope(interrupt_, context);
    const Clock::time_point begin = Clock::now();
    const auto reader = open(&context, *after);
    Record record;
    while (reader->Read(&record)) {
      if (record.number() != *after + 1) {
        context.TryCancel();
        (void)reader->Finish();
        return LocalError(absl::StatusCode::kInternal, reason, "number",
                          absl::StrCat(what, " ", record.number(), " came after ", what, " ",
                                       *after, "; this is a defect of the server"));
      }
      *after = record.number();
      *progressed = true;
      on_record(record);
      if (*after == last) {
        context.TryCancel();
        (void)reader->Finish();
        return absl::OkStatus();
      }
    }
    absl::Status status = FromGrpc(reader->Finish());
    // A watch of a quiet job is as good as one that brought something.
    *progressed |= MayHaveArrived() && Seconds(Clock::now() - begin) > options_.held_seconds;
    return status;
  });
}

absl::Status Client::FollowEvents(const std::string& name, int64_t* after, int64_t last,
                                  absl::FunctionRef<void(const v1::JobEvent&)> on_event) {
  const auto open = [&](grpc::ClientContext* context, int64_t from) {
    v1::WatchJobRequest request;
    request.set_name(name);
    request.set_after_event(from);
    return reconstruction_->WatchJob(context, request);
  };
  return Follow<v1::JobEvent>(open, "event", "EVENTS_BROKEN", after, last, on_event);
}

absl::Status Client::ListEvents(const std::string& name, int64_t last,
                                absl::FunctionRef<void(const v1::JobEvent&)> on_event) {
  int64_t after = 0;
  return last > 0 ? FollowEvents(name, &after, last, on_event) : absl::OkStatus();
}

absl::StatusOr<v1::Job> Client::WatchJob(const std::string& name, int64_t after,
                                         absl::FunctionRef<void(const v1::JobEvent&)> on_event) {
  while (true) {
    const absl::Status status = FollowEvents(name, &after, kNoLast, on_event);
    if (!status.ok()) return status;
    auto job = GetJob(name);
    // A job that was resumed just after it had ended goes on being watched.
    if (!job.ok() || report::HasEnded(job->state())) return job;
    if (!interrupt_.Sleep(std::chrono::milliseconds(200))) {
      return absl::CancelledError("interrupted");
    }
  }
}

absl::Status Client::GetLog(const std::string& name, int64_t after, bool follow,
                            absl::FunctionRef<void(const v1::LogEntry&)> on_entry) {
  const auto open = [&](grpc::ClientContext* context, int64_t from) {
    v1::GetLogRequest request;
    request.set_name(name);
    request.set_after_entry(from);
    request.set_follow(follow);
    return reconstruction_->GetLog(context, request);
  };
  return Follow<v1::LogEntry>(open, "entry", "LOG_BROKEN", &after, kNoLast, on_entry);
}

absl::StatusOr<v1::RenderedView> Client::RenderView(const v1::RenderViewRequest& request) {
  return Unary(*render_, &v1::RenderService::Stub::RenderView, request);
}

absl::StatusOr<v1::ListCamerasResponse> Client::ListCameras(const std::string& name) {
  v1::ListCamerasRequest request;
  request.set_name(name);
  v1::ListCamerasResponse all;
  do {
    auto page = Unary(*render_, &v1::RenderService::Stub::ListCameras, request);
    if (!page.ok()) return page.status();
    request.set_page_token(page->next_page_token());
    all.MergeFrom(*page);  // adds the cameras
  } while (!request.page_token().empty());
  all.clear_next_page_token();
  return all;
}

absl::Status Client::RenderPath(
    const v1::RenderPathRequest& request,
    absl::FunctionRef<absl::Status(const v1::RenderPathResponse&)> on_frame) {
  int next = 0;
  absl::Status refused;  // by on_frame: whatever its code, the call is not made again
  const absl::Status call = Retry([&](bool* progressed) {
    // A path cannot be taken up in the middle: a newer snapshot could make the rest look different.
    if (next > 0) {
      return LocalError(absl::StatusCode::kAborted, "PATH_INTERRUPTED", "",
                        absl::StrCat("the connection broke after ", report::Counted(next, "frame"),
                                     "; run the same command again"));
    }
    grpc::ClientContext context;
    Interrupt::Scope scope(interrupt_, context);
    auto reader = render_->RenderPath(&context, request);
    v1::RenderPathResponse response;
    int frames = 0;
    absl::Status status;
    while (status.ok() && refused.ok() && reader->Read(&response)) {
      *progressed = true;
      frames = response.frames();
      if (response.frame() != next++) {
        status = LocalError(absl::StatusCode::kInternal, "FRAMES_BROKEN", "frame",
                            absl::StrCat("frame ", response.frame(), " came instead of frame ",
                                         next - 1, "; this is a defect of the server"));
      } else {
        refused = on_frame(response);
      }
    }
    if (!status.ok() || !refused.ok()) context.TryCancel();
    const absl::Status finished = FromGrpc(reader->Finish());
    if (!status.ok() || !refused.ok()) return status;
    if (finished.ok() && (next == 0 || next != frames)) {
      return LocalError(absl::StatusCode::kInternal, "FRAMES_BROKEN", "frame",
                        absl::StrCat("the path ended after ", next, " of ", frames, " frames"));
    }
    return finished;
  });
  return refused.ok() ? call : refused;
}

absl::Status Client::ExportModel(const v1::ExportModelRequest& request,
                                 absl::FunctionRef<absl::Status(const v1::ExportHeader&)> on_header,
                                 absl::FunctionRef<absl::Status(std::string_view bytes)> on_bytes) {
  int64_t most = -1;     // that a try received: each begins with the first byte
  absl::Status refused;  // by on_header or on_bytes, as in RenderPath
  const absl::Status call = Retry([&](bool* progressed) {
    grpc::ClientContext context;
    Interrupt::Scope scope(interrupt_, context);
    auto reader = model_->ExportModel(&context, request);
    v1::ExportModelResponse response;
    int64_t expected = -1, received = 0;
    while (refused.ok() && reader->Read(&response)) {
      if (response.has_header()) {
        expected = response.header().size_bytes();
        refused = on_header(response.header());
      } else {
        received += static_cast<int64_t>(response.chunk().size());
        refused = on_bytes(response.chunk());
      }
      *progressed |= received > most;
      most = std::max(most, received);
    }
    if (!refused.ok()) context.TryCancel();
    const absl::Status finished = FromGrpc(reader->Finish());
    if (!refused.ok()) return absl::OkStatus();
    if (finished.ok() && received != expected) {
      return LocalError(
          absl::StatusCode::kInternal, "EXPORT_BROKEN", "",
          absl::StrCat("the server announced ", expected, " bytes and sent ", received));
    }
    return finished;
  });
  return refused.ok() ? call : refused;
}

absl::StatusOr<bool> Client::IsServing() {
  // An empty HealthCheckRequest, and HealthCheckResponse { Status status = 1; } with SERVING = 1,
  // by hand: no package installs their C++ classes.
  const grpc::Slice slice;
  std::string response_bytes;
  const absl::Status status = Retry([&](bool*) {
    grpc::ClientContext context;
    context.set_deadline(After(options_.call_seconds));
    Interrupt::Scope scope(interrupt_, context);
    grpc::ByteBuffer request(&slice, 1), response;
    grpc::CompletionQueue queue;
    auto call = grpc::GenericStub(channel_).PrepareUnaryCall(
        &context, "/grpc.health.v1.Health/Check", request, &queue);
    call->StartCall();
    grpc::Status result;
    call->Finish(&response, &result, &context);
    void* tag = nullptr;
    bool ok = false;
    queue.Next(&tag, &ok);
    std::vector<grpc::Slice> slices;
    if (result.ok() && response.Dump(&slices).ok()) {
      response_bytes.clear();
      for (const grpc::Slice& part : slices) {
        response_bytes.append(reinterpret_cast<const char*>(part.begin()), part.size());
      }
    }
    return FromGrpc(result);
  });
  if (!status.ok()) return status;
  return response_bytes == std::string("\x08\x01");
}

}  // namespace litags::client
