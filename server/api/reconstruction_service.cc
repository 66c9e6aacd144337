#include "server/api/reconstruction_service.h"

#include <spdlog/spdlog.h>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "proto/litags/v1/limits.h"
#include "server/api/convert.h"
#include "server/api/list_jobs.h"
#include "server/api/new_job.h"
#include "server/api/server_info.h"
#include "server/api/status.h"
#include "server/api/unary.h"
#include "server/api/upload_reactor.h"
#include "server/api/watch_reactor.h"

namespace litags {
namespace {

constexpr int kMaxJobsPerBatch = 100;

// The error of a field of a job, where the request has the job in `job`.
absl::Status InJob(const absl::Status& status) {
  const auto detail = GetErrorDetail(status);
  if (!detail || detail->field.empty() || detail->field == "update_mask") return status;
  return MakeError(status.code(), detail->reason, absl::StrCat("job.", detail->field),
                   std::string(status.message()));
}

absl::Status DeleteOne(Jobs& jobs, const std::string& name, bool allow_missing) {
  LITAGS_ASSIGN_OR_RETURN(const std::string id, ParseJobName(name));
  const absl::Status status = jobs.Delete(id);
  if (allow_missing && absl::IsNotFound(status)) return absl::OkStatus();
  if (status.ok()) spdlog::info("job={} deleted", id);
  return status;
}

}  // namespace

template <typename Request>
grpc::ServerUnaryReactor* ReconstructionServiceImpl::JobCall(
    Context* context, CallName name, const Request* request, v1::Job* response,
    absl::StatusOr<JobRecord> (Jobs::*change)(std::string_view)) {
  const auto work = [=](Call& call, const CancelToken&) -> absl::Status {
    LITAGS_ASSIGN_OR_RETURN(const std::string id, ParseJobName(request->name()));
    return Answer(*call.jobs(), (call.jobs()->*change)(id), response);
  };
  return RunUnary(gate_, context, name, pool_, request, response, work);
}

grpc::ServerUnaryReactor* ReconstructionServiceImpl::CreateJob(Context* context,
                                                               const v1::CreateJobRequest* request,
                                                               v1::Job* response) {
  const auto work = [=](Call& call, const CancelToken&) -> absl::Status {
    LITAGS_ASSIGN_OR_RETURN(const NewJob wanted, NewJobOf(*request));
    const auto job = call.jobs()->Create(wanted);
    if (job.ok()) spdlog::info("job={} created", job->id);
    return Answer(*call.jobs(), job, response);
  };
  return RunUnary(gate_, context, {"CreateJob", CallKind::kChange}, pool_, request, response, work);
}

grpc::ServerUnaryReactor* ReconstructionServiceImpl::GetServerInfo(
    Context* context, const v1::GetServerInfoRequest* request, v1::ServerInfo* response) {
  const auto work = [=](Call& call, const CancelToken&) -> absl::Status {
    LITAGS_ASSIGN_OR_RETURN(*response, DescribeServer(call));
    return absl::OkStatus();
  };
  return RunUnary(gate_, context, {"GetServerInfo", CallKind::kRead}, pool_, request, response,
                  work);
}

grpc::ServerUnaryReactor* ReconstructionServiceImpl::CloneJob(Context* context,
                                                              const v1::CloneJobRequest* request,
                                                              v1::Job* response) {
  const auto work = [=](Call& call, const CancelToken& cancel) -> absl::Status {
    LITAGS_ASSIGN_OR_RETURN(const std::string id, ParseJobName(request->name()));
    LITAGS_RETURN_IF_ERROR(CheckRequestId(request->request_id()));
    // The source may be gone since.
    LITAGS_ASSIGN_OR_RETURN(const auto made,
                            call.jobs()->MadeBy(request->request_id(), DigestOf(*request)));
    if (made && made->clone_source.empty()) return Answer(*call.jobs(), *made, response);
    LITAGS_ASSIGN_OR_RETURN(const JobRecord source, call.jobs()->Get(id));
    LITAGS_ASSIGN_OR_RETURN(const NewJob wanted, NewJobOf(*request, source));
    const auto job = call.jobs()->Clone(id, wanted, cancel);
    if (job.ok()) spdlog::info("job={} cloned from {}", job->id, id);
    return Answer(*call.jobs(), job, response);
  };
  return RunUnary(gate_, context, {"CloneJob", CallKind::kChange}, blob_pool_, request, response,
                  work);
}

grpc::ServerReadReactor<grpc::ByteBuffer>* ReconstructionServiceImpl::UploadImages(
    Context* context, grpc::ByteBuffer* response) {
  return RunStream<grpc::ServerReadReactor<grpc::ByteBuffer>>(
      gate_, context, {"UploadImages", CallKind::kStream}, nullptr,
      [&](std::shared_ptr<Call> call) {
        return new UploadReactor(std::move(call), response, uploads_);
      });
}

grpc::ServerUnaryReactor* ReconstructionServiceImpl::QueryUpload(
    Context* context, const v1::QueryUploadRequest* request, v1::QueryUploadResponse* response) {
  const auto work = [=](Call& call, const CancelToken&) -> absl::Status {
    LITAGS_ASSIGN_OR_RETURN(const std::string id, ParseJobName(request->name()));
    if (request->files_size() > v1::kMaxQueryFiles) {
      return InvalidInput(
          "TOO_MANY_IN_CALL", "files",
          absl::StrCat(request->files_size(), " files in one call; ask for at most ",
                       v1::kMaxQueryFiles, " at a time"));
    }
    Uploads& uploads = call.jobs()->uploads();
    std::vector<FileRecord> files;
    for (const v1::FileHeader& header : request->files()) {
      LITAGS_ASSIGN_OR_RETURN(UploadHeader file, ParseFileHeader(header, uploads.limits()));
      files.push_back(std::move(file.record));
    }
    LITAGS_ASSIGN_OR_RETURN(const auto statuses, uploads.Query(id, files));
    for (const FileStatus& status : statuses) {
      v1::FileStatus* proto = response->add_files();
      proto->set_stored(status.stored);
      proto->set_offset(status.offset);
    }
    return absl::OkStatus();
  };
  return RunUnary(gate_, context, {"QueryUpload", CallKind::kRead}, blob_pool_, request, response,
                  work);
}

grpc::ServerUnaryReactor* ReconstructionServiceImpl::ListFiles(Context* context,
                                                               const v1::ListFilesRequest* request,
                                                               v1::ListFilesResponse* response) {
  const auto work = [=](Call& call, const CancelToken&) -> absl::Status {
    LITAGS_RETURN_IF_ERROR(call.CheckRoom());
    return litags::ListFiles(*call.jobs(), *request, response);
  };
  return RunUnary(gate_, context, {"ListFiles", CallKind::kRead}, pool_, request, response, work);
}

grpc::ServerUnaryReactor* ReconstructionServiceImpl::DeleteFile(
    Context* context, const v1::DeleteFileRequest* request, google::protobuf::Empty* response) {
  const auto work = [=](Call& call, const CancelToken&) -> absl::Status {
    LITAGS_ASSIGN_OR_RETURN(const std::string id, ParseJobName(request->name()));
    LITAGS_ASSIGN_OR_RETURN(const FileRole role, ParseFileRole(request->role(), "role"));
    LITAGS_ASSIGN_OR_RETURN(const bool removed,
                            call.jobs()->uploads().Remove(id, role, request->file_name()));
    if (removed || request->allow_missing()) return absl::OkStatus();
    return MakeError(absl::StatusCode::kNotFound, "JOB_FILE_NOT_FOUND", "file_name",
                     absl::StrCat("jobs/", id,
                                  " has no such file of this role; ListFiles names "
                                  "those it has"));
  };
  return RunUnary(gate_, context, {"DeleteFile", CallKind::kChange}, pool_, request, response,
                  work);
}

grpc::ServerUnaryReactor* ReconstructionServiceImpl::StartJob(Context* context,
                                                              const v1::StartJobRequest* request,
                                                              v1::Job* response) {
  const auto work = [=](Call& call, const CancelToken&) -> absl::Status {
    LITAGS_ASSIGN_OR_RETURN(const std::string id, ParseJobName(request->name()));
    LITAGS_RETURN_IF_ERROR(CheckRequestId(request->request_id()));
    return Answer(*call.jobs(), call.jobs()->Start(id, request->request_id()), response);
  };
  return RunUnary(gate_, context, {"StartJob", CallKind::kChange}, pool_, request, response, work);
}

grpc::ServerUnaryReactor* ReconstructionServiceImpl::GetJob(Context* context,
                                                            const v1::GetJobRequest* request,
                                                            v1::Job* response) {
  return JobCall(context, {"GetJob", CallKind::kRead}, request, response, &Jobs::Get);
}

grpc::ServerUnaryReactor* ReconstructionServiceImpl::ListJobs(Context* context,
                                                              const v1::ListJobsRequest* request,
                                                              v1::ListJobsResponse* response) {
  const auto work = [=](Call& call, const CancelToken&) -> absl::Status {
    LITAGS_RETURN_IF_ERROR(call.CheckRoom());
    return litags::ListJobs(*call.jobs(), *request, response);
  };
  return RunUnary(gate_, context, {"ListJobs", CallKind::kRead}, pool_, request, response, work);
}

grpc::ServerWriteReactor<v1::JobEvent>* ReconstructionServiceImpl::WatchJob(
    Context* context, const v1::WatchJobRequest* request) {
  return RunStream<grpc::ServerWriteReactor<v1::JobEvent>>(
      gate_, context, {"WatchJob", CallKind::kStream}, request, [&](std::shared_ptr<Call> call) {
        ThreadPool* const pool = request->include_previews() ? blob_pool_ : pool_;
        return new WatchReactor(std::move(call), context, *request, hub_, pool);
      });
}

grpc::ServerWriteReactor<v1::LogEntry>* ReconstructionServiceImpl::GetLog(
    Context* context, const v1::GetLogRequest* request) {
  return RunStream<grpc::ServerWriteReactor<v1::LogEntry>>(
      gate_, context, {"GetLog", CallKind::kStream}, request, [&](std::shared_ptr<Call> call) {
        return new LogReactor(std::move(call), context, *request, hub_, pool_);
      });
}

grpc::ServerUnaryReactor* ReconstructionServiceImpl::UpdateJob(Context* context,
                                                               const v1::UpdateJobRequest* request,
                                                               v1::Job* response) {
  const auto work = [=](Call& call, const CancelToken&) -> absl::Status {
    const auto id = ParseJobName(request->job().name());
    if (!id.ok()) return InJob(id.status());
    const auto change = [&](JobDetails& details) { return ApplyUpdate(*request, &details); };
    const auto job = call.jobs()->Update(*id, request->job().etag(), change);
    return job.ok() ? Answer(*call.jobs(), job, response) : InJob(job.status());
  };
  return RunUnary(gate_, context, {"UpdateJob", CallKind::kChange}, pool_, request, response, work);
}

grpc::ServerUnaryReactor* ReconstructionServiceImpl::CancelJob(Context* context,
                                                               const v1::CancelJobRequest* request,
                                                               v1::Job* response) {
  return JobCall(context, {"CancelJob", CallKind::kChange}, request, response, &Jobs::Cancel);
}

grpc::ServerUnaryReactor* ReconstructionServiceImpl::ResumeJob(Context* context,
                                                               const v1::ResumeJobRequest* request,
                                                               v1::Job* response) {
  const auto work = [=](Call& call, const CancelToken&) -> absl::Status {
    LITAGS_ASSIGN_OR_RETURN(const std::string id, ParseJobName(request->name()));
    const auto change = [&](ReconstructOptions& options, JobPolicy& policy) -> absl::Status {
      const ReconstructOptions before = options;
      LITAGS_ASSIGN_OR_RETURN(options, OptionsFromProto(request->options(), before));
      // What clients see of a job has a tone, even where its method chose it.
      if (options.method == before.method && ToneInForce(options) == ToneInForce(before)) {
        options.tone = before.tone;
      }
      LITAGS_ASSIGN_OR_RETURN(policy, PolicyFromProto(request->policy(), policy));
      return absl::OkStatus();
    };
    LITAGS_RETURN_IF_ERROR(CheckRequestId(request->request_id()));
    return Answer(*call.jobs(), call.jobs()->Resume(id, change, request->request_id()), response);
  };
  return RunUnary(gate_, context, {"ResumeJob", CallKind::kChange}, pool_, request, response, work);
}

grpc::ServerUnaryReactor* ReconstructionServiceImpl::DeleteJob(Context* context,
                                                               const v1::DeleteJobRequest* request,
                                                               google::protobuf::Empty* response) {
  const auto work = [=](Call& call, const CancelToken&) -> absl::Status {
    return DeleteOne(*call.jobs(), request->name(), request->allow_missing());
  };
  return RunUnary(gate_, context, {"DeleteJob", CallKind::kChange}, blob_pool_, request, response,
                  work);
}

grpc::ServerUnaryReactor* ReconstructionServiceImpl::BatchDeleteJobs(
    Context* context, const v1::BatchDeleteJobsRequest* request,
    v1::BatchDeleteJobsResponse* response) {
  const auto work = [=](Call& call, const CancelToken& cancel) -> absl::Status {
    if (request->names_size() > kMaxJobsPerBatch) {
      return InvalidInput("TOO_MANY_IN_CALL", "names",
                          absl::StrCat(request->names_size(), " jobs in one call; name at most ",
                                       kMaxJobsPerBatch, " at a time"));
    }
    for (const std::string& name : request->names()) {
      if (cancel.IsCancelled()) return CallCancelled();
      const absl::Status status = DeleteOne(*call.jobs(), name, request->allow_missing());
      if (status.ok()) continue;
      // The store's own: those that follow would fail, too.
      if (absl::IsUnavailable(status) || absl::IsInternal(status)) return status;
      v1::BatchDeleteJobsResponse::Failure* failure = response->add_failures();
      failure->set_name(name);
      *failure->mutable_error() = ErrorToProto(JobError::Of(status));
    }
    return absl::OkStatus();
  };
  return RunUnary(gate_, context, {"BatchDeleteJobs", CallKind::kChange}, blob_pool_, request,
                  response, work);
}

}  // namespace litags
