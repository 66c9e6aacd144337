#include "server/jobs/client_job_store.h"

#include "absl/strings/str_cat.h"
#include "engine/core/counted.h"
#include "engine/core/error.h"

namespace litags {
absl::Status CheckByteQuota(int64_t bytes, int64_t max_bytes) {
  if (max_bytes == 0 || bytes <= max_bytes) return absl::OkStatus();
  return MakeError(
      absl::StatusCode::kResourceExhausted, "BYTE_QUOTA_REACHED", "",
      absl::StrCat("this client's jobs would hold ", bytes, " bytes, and may hold ", max_bytes,
                   "; delete old jobs, or ask the operator for a larger --max-bytes"));
}

absl::StatusOr<JobRecord> ClientJobStore::Create(const JobRecord& job, Change change) {
  JobRecord owned = job;
  owned.owner = view_.owner;
  return store_->Create(owned, [&](JobTransaction& transaction) -> absl::Status {
    LITAGS_RETURN_IF_ERROR(change(transaction));
    if (view_.max_jobs == 0) return absl::OkStatus();
    LITAGS_ASSIGN_OR_RETURN(const OwnerUsage usage, transaction.Usage());
    if (usage.jobs <= view_.max_jobs) return absl::OkStatus();
    return MakeError(
        absl::StatusCode::kResourceExhausted, "JOB_QUOTA_REACHED", "",
        absl::StrCat("this client has ", Counted(usage.jobs - 1, "job"), ", and may have ",
                     view_.max_jobs, "; delete some, or ask the operator for a larger --max-jobs"));
  });
}

absl::StatusOr<JobRecord> ClientJobStore::Get(std::string_view id) {
  LITAGS_ASSIGN_OR_RETURN(JobRecord job, store_->Get(id));
  if (!Sees(job)) return JobNotFound(id);
  return job;
}

absl::StatusOr<std::optional<JobRecord>> ClientJobStore::FindRequest(
    const std::string& owner, const std::string& request_id) {
  if (!view_.sees_all && owner != view_.owner) return std::nullopt;
  return store_->FindRequest(owner, request_id);
}

absl::StatusOr<std::vector<JobRecord>> ClientJobStore::List(int64_t after_time_ms,
                                                            std::string_view after_id, int limit,
                                                            const std::optional<std::string>& owner,
                                                            ListOrder order) {
  if (view_.sees_all) return store_->List(after_time_ms, after_id, limit, owner, order);
  if (owner && *owner != view_.owner) return std::vector<JobRecord>();
  return store_->List(after_time_ms, after_id, limit, view_.owner, order);
}

absl::StatusOr<JobRecord> ClientJobStore::Update(std::string_view id, Change change) {
  return store_->Update(id, [&](JobTransaction& job) -> absl::Status {
    if (!Sees(job.job)) return JobNotFound(id);
    if (view_.max_bytes == 0) return change(job);
    const int64_t bytes = job.Bytes();
    const JobState state = job.job.state;
    LITAGS_RETURN_IF_ERROR(change(job));
    // Whoever is above the quota may still do all that adds nothing. A run adds what it will leave.
    const bool runs = job.job.state == JobState::kQueued && state != JobState::kQueued;
    if (job.Bytes() <= bytes && !runs) return absl::OkStatus();
    LITAGS_ASSIGN_OR_RETURN(const OwnerUsage usage, job.Usage());
    return CheckByteQuota(usage.bytes, view_.max_bytes);
  });
}

absl::StatusOr<std::vector<FileRecord>> ClientJobStore::Files(std::string_view id) {
  LITAGS_RETURN_IF_ERROR(Get(id).status());
  return store_->Files(id);
}

absl::StatusOr<std::optional<FileRecord>> ClientJobStore::File(std::string_view id, FileRole role,
                                                               std::string_view name) {
  LITAGS_RETURN_IF_ERROR(Get(id).status());
  return store_->File(id, role, name);
}

absl::StatusOr<FileTally> ClientJobStore::Tally(std::string_view id, std::string_view sha256) {
  LITAGS_RETURN_IF_ERROR(Get(id).status());
  return store_->Tally(id, sha256);
}

absl::StatusOr<std::optional<JobFile>> ClientJobStore::FindFile(std::string_view id, FileRole role,
                                                                std::string_view sha256) {
  LITAGS_RETURN_IF_ERROR(Get(id).status());
  return store_->FindFile(id, role, sha256);
}

absl::StatusOr<OwnerUsage> ClientJobStore::UsageOf(std::string_view owner) {
  if (!view_.sees_all && owner != view_.owner) return OwnerUsage();
  return store_->UsageOf(owner);
}

absl::StatusOr<std::vector<std::string>> ClientJobStore::Uploading(std::string_view owner) {
  if (!view_.sees_all && owner != view_.owner) return std::vector<std::string>();
  return store_->Uploading(owner);
}

absl::StatusOr<std::vector<EventRecord>> ClientJobStore::Events(std::string_view id, int64_t after,
                                                                int limit) {
  LITAGS_RETURN_IF_ERROR(Get(id).status());
  return store_->Events(id, after, limit);
}

absl::StatusOr<std::vector<LogEntry>> ClientJobStore::Log(std::string_view id, int64_t after,
                                                          int limit) {
  LITAGS_RETURN_IF_ERROR(Get(id).status());
  return store_->Log(id, after, limit);
}

}  // namespace litags
