#ifndef LITAGS_SERVER_API_RECONSTRUCTION_SERVICE_H_
#define LITAGS_SERVER_API_RECONSTRUCTION_SERVICE_H_

#include "litags/v1/reconstruction_service.grpc.pb.h"
#include "server/api/event_hub.h"
#include "server/api/gate.h"
#include "server/api/thread_pool.h"
#include "server/api/upload_reactor.h"
#include "server/jobs/jobs.h"

namespace litags {

// Handlers of litags.v1.ReconstructionService: validate, call Jobs, convert.
//
// UploadImages gets its messages as bytes: of one that does not parse, gRPC tells nothing but that
// the stream has ended, as after the last.
class ReconstructionServiceImpl
    : public v1::ReconstructionService::WithRawCallbackMethod_UploadImages<
          v1::ReconstructionService::CallbackService> {
 public:
  // All must outlive this; `pool` runs what touches the job store only and is short, that of
  // `uploads` what reads and writes files.
  ReconstructionServiceImpl(Gate* gate, EventHub* hub, ThreadPool* pool, UploadResources uploads)
      : gate_(gate), hub_(hub), pool_(pool), blob_pool_(uploads.pool), uploads_(uploads) {}

  using Context = grpc::CallbackServerContext;

  grpc::ServerUnaryReactor* CreateJob(Context* context, const v1::CreateJobRequest* request,
                                      v1::Job* response) override;
  grpc::ServerUnaryReactor* GetServerInfo(Context* context, const v1::GetServerInfoRequest* request,
                                          v1::ServerInfo* response) override;
  grpc::ServerUnaryReactor* CloneJob(Context* context, const v1::CloneJobRequest* request,
                                     v1::Job* response) override;
  grpc::ServerUnaryReactor* QueryUpload(Context* context, const v1::QueryUploadRequest* request,
                                        v1::QueryUploadResponse* response) override;
  grpc::ServerReadReactor<grpc::ByteBuffer>* UploadImages(Context* context,
                                                          grpc::ByteBuffer* response) override;
  grpc::ServerUnaryReactor* ListFiles(Context* context, const v1::ListFilesRequest* request,
                                      v1::ListFilesResponse* response) override;
  grpc::ServerUnaryReactor* DeleteFile(Context* context, const v1::DeleteFileRequest* request,
                                       google::protobuf::Empty* response) override;
  grpc::ServerUnaryReactor* StartJob(Context* context, const v1::StartJobRequest* request,
                                     v1::Job* response) override;
  grpc::ServerUnaryReactor* GetJob(Context* context, const v1::GetJobRequest* request,
                                   v1::Job* response) override;
  grpc::ServerUnaryReactor* ListJobs(Context* context, const v1::ListJobsRequest* request,
                                     v1::ListJobsResponse* response) override;
  grpc::ServerWriteReactor<v1::JobEvent>* WatchJob(Context* context,
                                                   const v1::WatchJobRequest* request) override;
  grpc::ServerWriteReactor<v1::LogEntry>* GetLog(Context* context,
                                                 const v1::GetLogRequest* request) override;
  grpc::ServerUnaryReactor* UpdateJob(Context* context, const v1::UpdateJobRequest* request,
                                      v1::Job* response) override;
  grpc::ServerUnaryReactor* CancelJob(Context* context, const v1::CancelJobRequest* request,
                                      v1::Job* response) override;
  grpc::ServerUnaryReactor* ResumeJob(Context* context, const v1::ResumeJobRequest* request,
                                      v1::Job* response) override;
  grpc::ServerUnaryReactor* DeleteJob(Context* context, const v1::DeleteJobRequest* request,
                                      google::protobuf::Empty* response) override;
  grpc::ServerUnaryReactor* BatchDeleteJobs(Context* context,
                                            const v1::BatchDeleteJobsRequest* request,
                                            v1::BatchDeleteJobsResponse* response) override;

 private:
  // A call that names a job and answers with it: `change` is a method of Jobs.
  template <typename Request>
  grpc::ServerUnaryReactor* JobCall(Context* context, CallName name, const Request* request,
                                    v1::Job* response,
                                    absl::StatusOr<JobRecord> (Jobs::*change)(std::string_view));

  Gate* const gate_;
  EventHub* const hub_;
  ThreadPool* const pool_;
  ThreadPool* const blob_pool_;
  const UploadResources uploads_;
};

}  // namespace litags

#endif  // LITAGS_SERVER_API_RECONSTRUCTION_SERVICE_H_
