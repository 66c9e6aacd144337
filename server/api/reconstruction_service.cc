#include "server/api/reconstruction_service.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <charconv>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "engine/core/utf8.h"
#include "proto/litags/v1/limits.h"
#include "server/api/convert.h"
#include "server/api/status.h"
#include "server/api/unary.h"
#include "server/api/upload_reactor.h"
#include "server/api/upload_session.h"
#include "server/api/watch_reactor.h"
#include "server/store/digest.h"

namespace litags {
namespace {

constexpr size_t kMaxRequestIdLength = 64;
constexpr size_t kMaxDisplayNameBytes = 200;
constexpr int kMaxContentDigestBytes = 64;
constexpr int kDefaultPageSize = 50, kMaxPageSize = 1000;

// Lists and logs, also an administrator's, show it as it is.
absl::Status CheckText(const std::string& text, const char* field) {
  if (!HoldsControl(text)) return absl::OkStatus();
  return InvalidInput("TEXT_INVALID", field,
                      absl::StrCat(field,
                                   " holds a control character, a line break, or a character that "
                                   "turns text around; leave it out"));
}

absl::Status Describe(const JobRecord& job, const Workforce& workers, v1::Job* response) {
  LITAGS_ASSIGN_OR_RETURN(*response, JobToProto(job));
  response->set_waits_for(WaitsFor(job, workers));
  return absl::OkStatus();
}

absl::Status Answer(Jobs& jobs, const absl::StatusOr<JobRecord>& job, v1::Job* response) {
  LITAGS_RETURN_IF_ERROR(job.status());
  Workforce workers;
  if (job->state == JobState::kQueued) {
    LITAGS_ASSIGN_OR_RETURN(workers, jobs.Workers());
  }
  return Describe(*job, workers, response);
}

// A page token is where the next page starts: creation time and id of the last job shown.
struct PageStart {
  int64_t time_ms = 0;
  std::string id;
};

std::string PageToken(const JobRecord& last) {
  return absl::StrCat(last.create_time_ms, "-", last.id);
}

absl::StatusOr<PageStart> ParsePageToken(const std::string& token) {
  PageStart start;
  if (token.empty()) return start;
  const char* end = token.data() + token.size();
  const auto [rest, error] = std::from_chars(token.data(), end, start.time_ms);
  if (error != std::errc() || start.time_ms <= 0 || rest == end || *rest != '-' ||
      !std::all_of(rest + 1, end, absl::ascii_isalnum)) {
    return InvalidInput("PAGE_TOKEN_INVALID", "page_token",
                        "page_token is not one that ListJobs returned; start with an empty one");
  }
  start.id.assign(rest + 1, end);
  return start;
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
  return RunUnary(gate_, context, name, pool_, work);
}

grpc::ServerUnaryReactor* ReconstructionServiceImpl::CreateJob(Context* context,
                                                               const v1::CreateJobRequest* request,
                                                               v1::Job* response) {
  const auto work = [=](Call& call, const CancelToken&) -> absl::Status {
    if (request->request_id().size() > kMaxRequestIdLength) {
      return InvalidInput(
          "REQUEST_ID_INVALID", "request_id",
          absl::StrCat("request_id has ", request->request_id().size(), " characters; at most ",
                       kMaxRequestIdLength, " are allowed, a UUID has 36"));
    }
    LITAGS_RETURN_IF_ERROR(CheckText(request->request_id(), "request_id"));
    LITAGS_RETURN_IF_ERROR(CheckText(request->display_name(), "display_name"));
    if (request->display_name().size() > kMaxDisplayNameBytes) {
      return InvalidInput("DISPLAY_NAME_TOO_LONG", "display_name",
                          absl::StrCat("display_name has ", request->display_name().size(),
                                       " bytes; at most ", kMaxDisplayNameBytes, " are allowed"));
    }
    if (request->content_digest().size() > kMaxContentDigestBytes) {
      return InvalidInput(
          "CONTENT_DIGEST_INVALID", "content_digest",
          absl::StrCat("content_digest has ", request->content_digest().size(), " bytes; at most ",
                       kMaxContentDigestBytes, " are allowed, SHA-256 has 32"));
    }
    NewJob wanted{
        request->request_id(), request->display_name(), ToHex(request->content_digest()), {}, {}};
    LITAGS_ASSIGN_OR_RETURN(wanted.policy, PolicyFromProto(request->policy()));
    LITAGS_ASSIGN_OR_RETURN(wanted.options, OptionsFromProto(request->options()));
    // Equal requests have equal bytes: the message holds no map.
    wanted.request_digest = Sha256::Hex(request->SerializeAsString());
    const auto job = call.jobs()->Create(wanted);
    if (job.ok()) spdlog::info("job={} created", job->id);
    return Answer(*call.jobs(), job, response);
  };
  return RunUnary(gate_, context, {"CreateJob", CallKind::kChange}, pool_, work);
}

grpc::ServerReadReactor<grpc::ByteBuffer>* ReconstructionServiceImpl::UploadImages(
    Context* context, grpc::ByteBuffer* response) {
  return RunStream<grpc::ServerReadReactor<grpc::ByteBuffer>>(
      gate_, context, {"UploadImages", CallKind::kStream}, [&](std::shared_ptr<Call> call) {
        return new UploadReactor(std::move(call), response, uploads_);
      });
}

grpc::ServerUnaryReactor* ReconstructionServiceImpl::QueryUpload(
    Context* context, const v1::QueryUploadRequest* request, v1::QueryUploadResponse* response) {
  const auto work = [=](Call& call, const CancelToken&) -> absl::Status {
    LITAGS_ASSIGN_OR_RETURN(const std::string id, ParseJobName(request->name()));
    if (request->files_size() > v1::kMaxQueryFiles) {
      return InvalidInput(
          "TOO_MANY_FILES", "files",
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
  return RunUnary(gate_, context, {"QueryUpload", CallKind::kRead}, blob_pool_, work);
}

grpc::ServerUnaryReactor* ReconstructionServiceImpl::StartJob(Context* context,
                                                              const v1::StartJobRequest* request,
                                                              v1::Job* response) {
  return JobCall(context, {"StartJob", CallKind::kChange}, request, response, &Jobs::Start);
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
    const int size = request->page_size() == 0 ? kDefaultPageSize : request->page_size();
    if (size < 0 || size > kMaxPageSize) {
      return InvalidInput("PAGE_SIZE_INVALID", "page_size",
                          absl::StrCat("page_size is ", size, "; it must be in 1..", kMaxPageSize));
    }
    LITAGS_ASSIGN_OR_RETURN(const PageStart start, ParsePageToken(request->page_token()));
    // One more than asked for tells whether there is a next page.
    LITAGS_ASSIGN_OR_RETURN(std::vector<JobRecord> jobs,
                            call.jobs()->List(start.time_ms, start.id, size + 1));
    if (jobs.size() > static_cast<size_t>(size)) {
      jobs.resize(size);
      response->set_next_page_token(PageToken(jobs.back()));
    }
    LITAGS_ASSIGN_OR_RETURN(const Workforce workers, call.jobs()->Workers());
    for (const JobRecord& job : jobs) {
      LITAGS_RETURN_IF_ERROR(Describe(job, workers, response->add_jobs()));
    }
    return absl::OkStatus();
  };
  return RunUnary(gate_, context, {"ListJobs", CallKind::kRead}, pool_, work);
}

grpc::ServerWriteReactor<v1::JobEvent>* ReconstructionServiceImpl::WatchJob(
    Context* context, const v1::WatchJobRequest* request) {
  return RunStream<grpc::ServerWriteReactor<v1::JobEvent>>(
      gate_, context, {"WatchJob", CallKind::kStream}, [&](std::shared_ptr<Call> call) {
        ThreadPool* const pool = request->include_previews() ? blob_pool_ : pool_;
        return new WatchReactor(std::move(call), context, *request, hub_, pool);
      });
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
      LITAGS_ASSIGN_OR_RETURN(options, OptionsFromProto(request->options(), options));
      LITAGS_ASSIGN_OR_RETURN(policy, PolicyFromProto(request->policy(), policy));
      return absl::OkStatus();
    };
    return Answer(*call.jobs(), call.jobs()->Resume(id, change), response);
  };
  return RunUnary(gate_, context, {"ResumeJob", CallKind::kChange}, pool_, work);
}

grpc::ServerUnaryReactor* ReconstructionServiceImpl::DeleteJob(Context* context,
                                                               const v1::DeleteJobRequest* request,
                                                               google::protobuf::Empty*) {
  const auto work = [=](Call& call, const CancelToken&) -> absl::Status {
    LITAGS_ASSIGN_OR_RETURN(const std::string id, ParseJobName(request->name()));
    LITAGS_RETURN_IF_ERROR(call.jobs()->Delete(id));
    spdlog::info("job={} deleted", id);
    return absl::OkStatus();
  };
  return RunUnary(gate_, context, {"DeleteJob", CallKind::kChange}, blob_pool_, work);
}

}  // namespace litags
