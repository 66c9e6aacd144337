#include "server/api/reconstruction_service.h"

#include <spdlog/spdlog.h>

#include <charconv>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
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
constexpr int kMaxQueryFiles = 1000;
constexpr int kDefaultPageSize = 50, kMaxPageSize = 1000;

absl::Status Answer(const absl::StatusOr<JobRecord>& job, v1::Job* response) {
  LITAGS_RETURN_IF_ERROR(job.status());
  LITAGS_ASSIGN_OR_RETURN(*response, JobToProto(*job));
  return absl::OkStatus();
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
  if (error != std::errc() || start.time_ms <= 0 || rest == end || *rest != '-') {
    return InvalidInput("PAGE_TOKEN_INVALID", "page_token",
                        "page_token is not one that ListJobs returned; start with an empty one");
  }
  start.id.assign(rest + 1, end);
  return start;
}

}  // namespace

template <typename Request>
grpc::ServerUnaryReactor* ReconstructionServiceImpl::JobCall(
    Context* context, const Request* request, v1::Job* response,
    absl::StatusOr<JobRecord> (Jobs::*change)(std::string_view)) {
  return RunUnary(context, pool_, [=, this]() -> absl::Status {
    LITAGS_ASSIGN_OR_RETURN(const std::string id, ParseJobName(request->name()));
    return Answer((jobs_->*change)(id), response);
  });
}

grpc::ServerUnaryReactor* ReconstructionServiceImpl::CreateJob(Context* context,
                                                               const v1::CreateJobRequest* request,
                                                               v1::Job* response) {
  return RunUnary(context, pool_, [=, this]() -> absl::Status {
    if (request->request_id().size() > kMaxRequestIdLength) {
      return InvalidInput(
          "REQUEST_ID_INVALID", "request_id",
          absl::StrCat("request_id has ", request->request_id().size(), " characters; at most ",
                       kMaxRequestIdLength, " are allowed, a UUID has 36"));
    }
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
    const auto job = jobs_->Create(wanted);
    if (job.ok()) spdlog::info("job={} created", job->id);
    return Answer(job, response);
  });
}

grpc::ServerReadReactor<v1::UploadImagesRequest>* ReconstructionServiceImpl::UploadImages(
    Context* context, v1::UploadImagesResponse* response) {
  return new UploadReactor(context, response, jobs_, pool_);
}

grpc::ServerUnaryReactor* ReconstructionServiceImpl::QueryUpload(
    Context* context, const v1::QueryUploadRequest* request, v1::QueryUploadResponse* response) {
  return RunUnary(context, pool_, [=, this]() -> absl::Status {
    LITAGS_ASSIGN_OR_RETURN(const std::string id, ParseJobName(request->name()));
    if (request->files_size() > kMaxQueryFiles) {
      return InvalidInput(
          "TOO_MANY_FILES", "files",
          absl::StrCat(request->files_size(), " files in one call; ask for at most ",
                       kMaxQueryFiles, " at a time"));
    }
    std::vector<FileRecord> files;
    for (const v1::FileHeader& header : request->files()) {
      LITAGS_ASSIGN_OR_RETURN(UploadHeader file,
                              ParseFileHeader(header, jobs_->uploads().limits()));
      files.push_back(std::move(file.record));
    }
    LITAGS_ASSIGN_OR_RETURN(const auto statuses, jobs_->uploads().Query(id, files));
    for (const FileStatus& status : statuses) {
      v1::FileStatus* proto = response->add_files();
      proto->set_stored(status.stored);
      proto->set_offset(status.offset);
    }
    return absl::OkStatus();
  });
}

grpc::ServerUnaryReactor* ReconstructionServiceImpl::StartJob(Context* context,
                                                              const v1::StartJobRequest* request,
                                                              v1::Job* response) {
  return JobCall(context, request, response, &Jobs::Start);
}

grpc::ServerUnaryReactor* ReconstructionServiceImpl::GetJob(Context* context,
                                                            const v1::GetJobRequest* request,
                                                            v1::Job* response) {
  return JobCall(context, request, response, &Jobs::Get);
}

grpc::ServerUnaryReactor* ReconstructionServiceImpl::ListJobs(Context* context,
                                                              const v1::ListJobsRequest* request,
                                                              v1::ListJobsResponse* response) {
  return RunUnary(context, pool_, [=, this]() -> absl::Status {
    const int size = request->page_size() == 0 ? kDefaultPageSize : request->page_size();
    if (size < 0 || size > kMaxPageSize) {
      return InvalidInput("PAGE_SIZE_INVALID", "page_size",
                          absl::StrCat("page_size is ", size, "; it must be in 1..", kMaxPageSize));
    }
    LITAGS_ASSIGN_OR_RETURN(const PageStart start, ParsePageToken(request->page_token()));
    // One more than asked for tells whether there is a next page.
    LITAGS_ASSIGN_OR_RETURN(std::vector<JobRecord> jobs,
                            jobs_->List(start.time_ms, start.id, size + 1));
    if (jobs.size() > static_cast<size_t>(size)) {
      jobs.resize(size);
      response->set_next_page_token(PageToken(jobs.back()));
    }
    for (const JobRecord& job : jobs) {
      LITAGS_RETURN_IF_ERROR(Answer(job, response->add_jobs()));
    }
    return absl::OkStatus();
  });
}

grpc::ServerWriteReactor<v1::JobEvent>* ReconstructionServiceImpl::WatchJob(
    Context* context, const v1::WatchJobRequest* request) {
  return new WatchReactor(context, *request, jobs_, hub_, pool_);
}

grpc::ServerUnaryReactor* ReconstructionServiceImpl::CancelJob(Context* context,
                                                               const v1::CancelJobRequest* request,
                                                               v1::Job* response) {
  return JobCall(context, request, response, &Jobs::Cancel);
}

grpc::ServerUnaryReactor* ReconstructionServiceImpl::ResumeJob(Context* context,
                                                               const v1::ResumeJobRequest* request,
                                                               v1::Job* response) {
  return JobCall(context, request, response, &Jobs::Resume);
}

grpc::ServerUnaryReactor* ReconstructionServiceImpl::DeleteJob(Context* context,
                                                               const v1::DeleteJobRequest* request,
                                                               google::protobuf::Empty*) {
  return RunUnary(context, pool_, [=, this]() -> absl::Status {
    LITAGS_ASSIGN_OR_RETURN(const std::string id, ParseJobName(request->name()));
    LITAGS_RETURN_IF_ERROR(jobs_->Delete(id));
    spdlog::info("job={} deleted", id);
    return absl::OkStatus();
  });
}

}  // namespace litags
