// The service as C++ functions: connects, retries broken connections, checks what streams promise.
#ifndef LITAGS_CLIENT_CLIENT_H_
#define LITAGS_CLIENT_CLIENT_H_

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>

#include "absl/functional/function_ref.h"
#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "client/interrupt.h"
#include "grpcpp/channel.h"
#include "litags/v1/job.pb.h"
#include "litags/v1/model_service.grpc.pb.h"
#include "litags/v1/reconstruction_service.grpc.pb.h"
#include "litags/v1/render_service.grpc.pb.h"

namespace litags::client {

struct ClientOptions {
  // A connection that was there and broke is tried again for this long, seconds, with growing
  // pauses; a call that gets further than before, or a watch that held for held_seconds, starts the
  // time anew. A server that never answered is tried for start_seconds at most: it may have been
  // started just now.
  double retry_seconds = 120, start_seconds = 5;
  double held_seconds = 20;  // longer than it takes to find that there is no server
  // The first pause, seconds; doubled up to max_pause_seconds, +-20 % at random.
  double first_pause_seconds = 0.25;
  double max_pause_seconds = 5;
  // Limit of calls with one answer, seconds. Streams have none.
  double call_seconds = 60;
  // Told before each pause: why, and for how long.
  std::function<void(const absl::Status& why, double pause_seconds)> on_retry;
};

// "7f3a" or "jobs/7f3a" to "jobs/7f3a".
std::string JobName(std::string_view job);

// 128 random bits as 32 hex digits, for CreateJobRequest.request_id.
std::string RandomId();

// Whether the same call may succeed later: the connection broke, the server is busy, or did not
// answer.
bool MayBeTriedAgain(const absl::Status& status);

// One server. Errors are those of the service (proto/litags/v1) with their detail, UNAVAILABLE if
// no server answers, CANCELLED after Interrupt::Raise(). Thread-safe. `interrupt` must outlive it.
class Client {
 public:
  Client(std::shared_ptr<grpc::Channel> channel, ClientOptions options, Interrupt& interrupt);

  // An empty request_id is replaced by a random one, so that a retry makes no second job.
  absl::StatusOr<v1::Job> CreateJob(v1::CreateJobRequest request);
  absl::StatusOr<v1::Job> CloneJob(v1::CloneJobRequest request);
  absl::StatusOr<v1::Job> StartJob(const std::string& name);
  absl::StatusOr<v1::Job> GetJob(const std::string& name);
  absl::StatusOr<v1::ListJobsResponse> ListJobs(const v1::ListJobsRequest& request);
  absl::StatusOr<v1::Job> CancelJob(const std::string& name);
  absl::StatusOr<v1::Job> ResumeJob(v1::ResumeJobRequest request);
  absl::StatusOr<v1::Job> UpdateJob(const v1::UpdateJobRequest& request);
  absl::StatusOr<v1::ListFilesResponse> ListFiles(const v1::ListFilesRequest& request);
  absl::Status DeleteFile(const v1::DeleteFileRequest& request);
  absl::StatusOr<v1::ServerInfo> GetServerInfo();
  // NOT_FOUND if there was no such job; OK if an earlier try, whose answer was lost, may have
  // removed it.
  absl::Status DeleteJob(const std::string& name);

  // Calls on_event for every event numbered above `after`, in order, each once, across broken
  // connections, until the job has ended. Returns the job as it then is. INTERNAL (EVENTS_BROKEN)
  // if the server skips or repeats a number.
  absl::StatusOr<v1::Job> WatchJob(const std::string& name, int64_t after,
                                   absl::FunctionRef<void(const v1::JobEvent&)> on_event);

  // Events 1 to `last`, which must have been written, as Job.last_event is.
  absl::Status ListEvents(const std::string& name, int64_t last,
                          absl::FunctionRef<void(const v1::JobEvent&)> on_event);

  // The same as WatchJob of the job's log, until its end as it is now, or with `follow` until the
  // job has ended.
  absl::Status GetLog(const std::string& name, int64_t after, bool follow,
                      absl::FunctionRef<void(const v1::LogEntry&)> on_entry);

  absl::StatusOr<v1::RenderedView> RenderView(const v1::RenderViewRequest& request);
  absl::StatusOr<v1::ListCamerasResponse> ListCameras(const std::string& name);

  // Frames in order as they arrive; an error of on_frame ends the call and is returned. INTERNAL
  // (FRAMES_BROKEN) if one is missing.
  absl::Status RenderPath(const v1::RenderPathRequest& request,
                          absl::FunctionRef<absl::Status(const v1::RenderPathResponse&)> on_frame);

  // The file's header, then its bytes in order. After a broken connection it begins again, with
  // on_header. An error of theirs ends the call and is returned. INTERNAL (EXPORT_BROKEN) if the
  // length is not the announced one.
  absl::Status ExportModel(const v1::ExportModelRequest& request,
                           absl::FunctionRef<absl::Status(const v1::ExportHeader&)> on_header,
                           absl::FunctionRef<absl::Status(std::string_view bytes)> on_bytes);

  // grpc.health.v1: whether the server says SERVING of all that it serves.
  absl::StatusOr<bool> IsServing();

  // Runs `attempt` again while its connection is broken, as ClientOptions says; `attempt` sets its
  // argument to true when it got further than before.
  absl::Status Retry(absl::FunctionRef<absl::Status(bool* progressed)> attempt);

  // For streams of our own: the stub, and what ends a call in progress.
  v1::ReconstructionService::Stub& reconstruction() { return *reconstruction_; }
  Interrupt& interrupt() { return interrupt_; }

 private:
  // Until then, or until a connection that was not there is; false if interrupted.
  bool Wait(double seconds);
  // False if the call that has just failed had no connection to be sent over.
  bool MayHaveArrived() const;
  // The answer of `call(context, response)`, which Retry() runs.
  template <class Response, class Call>
  absl::StatusOr<Response> Unary(Call call);
  // The same of a method of a stub.
  template <class Stub, class Request, class Response>
  absl::StatusOr<Response> Unary(Stub& stub,
                                 grpc::Status (Stub::*method)(grpc::ClientContext*, const Request&,
                                                              Response*),
                                 const Request& request);
  // Reads the numbered records of the stream that `open(context, *after)` begins, across broken
  // connections, to its end or to number `last`. INTERNAL with `reason` if the server skips or
  // repeats a number.
  template <class Record, class Open>
  absl::Status Follow(Open open, const char* what, const char* reason, int64_t* after, int64_t last,
                      absl::FunctionRef<void(const Record&)> on_record);
  // WatchJob's stream of events after *after, as Follow() reads it.
  absl::Status FollowEvents(const std::string& name, int64_t* after, int64_t last,
                            absl::FunctionRef<void(const v1::JobEvent&)> on_event);

  std::shared_ptr<grpc::Channel> channel_;
  ClientOptions options_;
  Interrupt& interrupt_;
  std::unique_ptr<v1::ReconstructionService::Stub> reconstruction_;
  std::unique_ptr<v1::RenderService::Stub> render_;
  std::unique_ptr<v1::ModelService::Stub> model_;
  std::atomic<bool> answered_ = false;  // the server has answered a call
};

}  // namespace litags::client

#endif  // LITAGS_CLIENT_CLIENT_H_
