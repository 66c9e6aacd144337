#include "server/store/sql_job_store.h"

#include "engine/core/error.h"
#include "server/store/digest.h"
#include "server/store/sql_files.h"
#include "server/store/sql_queue.h"

namespace litags {

absl::StatusOr<JobRecord> SqlJobStore::Create(const JobRecord& job, Change change) {
  JobRecord result;
  LITAGS_RETURN_IF_ERROR(Write([&](SqlSession& sql) -> absl::StatusOr<bool> {
    LITAGS_ASSIGN_OR_RETURN(const bool inserted, InsertJob(sql, job));
    if (inserted) {
      LITAGS_ASSIGN_OR_RETURN(result, ApplyChange(sql, job, change));
      return true;
    }
    LITAGS_ASSIGN_OR_RETURN(auto first, SelectByRequest(sql, job.owner, job.request_id));
    if (!first) {
      return MakeError(absl::StatusCode::kUnavailable, "JOB_BUSY", "request_id",
                       "the other job of this request_id was deleted just now; try again");
    }
    result = *std::move(first);
    return false;
  }));
  return result;
}

absl::StatusOr<JobRecord> SqlJobStore::Get(std::string_view id) {
  return Answer([&](SqlSession& sql) { return SelectJob(sql, id); });
}

absl::StatusOr<std::optional<JobRecord>> SqlJobStore::FindRequest(const std::string& owner,
                                                                  const std::string& request_id) {
  return Answer([&](SqlSession& sql) { return SelectByRequest(sql, owner, request_id); });
}

absl::StatusOr<std::vector<JobRecord>> SqlJobStore::List(int64_t after_time_ms,
                                                         std::string_view after_id, int limit,
                                                         const std::optional<std::string>& owner,
                                                         ListOrder order) {
  return Answer([&](SqlSession& sql) {
    return SelectPage(sql, after_time_ms, after_id, limit, owner, order);
  });
}

absl::StatusOr<JobRecord> SqlJobStore::Update(std::string_view id, Change change) {
  JobRecord result;
  LITAGS_RETURN_IF_ERROR(Write([&](SqlSession& sql) -> absl::StatusOr<bool> {
    LITAGS_ASSIGN_OR_RETURN(JobRecord job, SelectJob(sql, id, lock_));
    LITAGS_ASSIGN_OR_RETURN(result, ApplyChange(sql, std::move(job), change));
    return true;
  }));
  return result;
}

absl::StatusOr<std::optional<JobRecord>> SqlJobStore::UpdateFirst(Select select, Change change) {
  std::optional<std::string> id;
  // Most calls find nothing: look before opening a transaction.
  LITAGS_RETURN_IF_ERROR(Read([&](SqlSession& sql) -> absl::Status {
    LITAGS_ASSIGN_OR_RETURN(id, select(sql, ""));
    return absl::OkStatus();
  }));
  std::optional<JobRecord> result;
  if (!id) return result;
  LITAGS_RETURN_IF_ERROR(Write([&](SqlSession& sql) -> absl::StatusOr<bool> {
    result.reset();
    LITAGS_ASSIGN_OR_RETURN(id, select(sql, lock_or_skip_));
    if (!id) return false;
    LITAGS_ASSIGN_OR_RETURN(JobRecord job, SelectJob(sql, *id));
    LITAGS_ASSIGN_OR_RETURN(result, ApplyChange(sql, std::move(job), change));
    return true;
  }));
  return result;
}

absl::StatusOr<std::optional<JobRecord>> SqlJobStore::UpdateFirstQueued(Fits fits, Change change) {
  return UpdateFirst(
      [&](SqlSession& sql, std::string_view lock) { return SelectQueued(sql, fits, lock); },
      change);
}

absl::StatusOr<std::optional<JobRecord>> SqlJobStore::UpdateFirstExpired(int64_t now_ms,
                                                                         Change change) {
  return UpdateFirst(
      [&](SqlSession& sql, std::string_view lock) {
        return SelectFirst(sql, FirstOf::kExpired, now_ms, lock);
      },
      change);
}

absl::StatusOr<std::optional<JobRecord>> SqlJobStore::UpdateFirstLeasedBeyond(int64_t latest_ms,
                                                                              Change change) {
  return UpdateFirst(
      [&](SqlSession& sql, std::string_view lock) {
        return SelectFirst(sql, FirstOf::kLeasedBeyond, latest_ms, lock);
      },
      change);
}

absl::StatusOr<std::vector<std::string>> SqlJobStore::LeasedTo(std::string_view owner) {
  return Answer([&](SqlSession& sql) { return SelectLeasedTo(sql, owner); });
}

absl::StatusOr<std::vector<std::string>> SqlJobStore::Expired(int64_t now_ms, int limit) {
  return Answer([&](SqlSession& sql) { return SelectExpired(sql, now_ms, limit); });
}

absl::StatusOr<std::vector<std::string>> SqlJobStore::WebhooksDue(int64_t now_ms, int64_t latest_ms,
                                                                  int limit) {
  return Answer([&](SqlSession& sql) { return SelectWebhooksDue(sql, now_ms, latest_ms, limit); });
}

absl::StatusOr<std::vector<std::string>> SqlJobStore::JobsWithUnreferencedBlobs(int limit) {
  return Answer([&](SqlSession& sql) { return SelectJobsWithUnreferencedBlobs(sql, limit); });
}

absl::StatusOr<JobCensus> SqlJobStore::Census() {
  return Answer([&](SqlSession& sql) { return SelectCensus(sql); });
}

absl::StatusOr<JobQueue> SqlJobStore::Queue() {
  return Answer([&](SqlSession& sql) { return SelectQueue(sql); });
}

absl::StatusOr<OwnerUsage> SqlJobStore::UsageOf(std::string_view owner) {
  return Answer([&](SqlSession& sql) { return SelectUsage(sql, owner, /*but=*/""); });
}

absl::StatusOr<std::vector<std::string>> SqlJobStore::Uploading(std::string_view owner) {
  return Answer([&](SqlSession& sql) { return SelectUploading(sql, owner); });
}

absl::Status SqlJobStore::PutWorker(const WorkerRecord& worker) {
  return Write([&](SqlSession& sql) -> absl::StatusOr<bool> {
    LITAGS_RETURN_IF_ERROR(UpsertWorker(sql, worker));
    return true;
  });
}

absl::Status SqlJobStore::RemoveWorker(std::string_view name) {
  return Write([&](SqlSession& sql) -> absl::StatusOr<bool> {
    LITAGS_RETURN_IF_ERROR(DeleteWorker(sql, name));
    return true;
  });
}

absl::StatusOr<std::vector<WorkerRecord>> SqlJobStore::Workers(int64_t since_ms) {
  return Answer([&](SqlSession& sql) { return SelectWorkers(sql, since_ms); });
}

absl::StatusOr<std::vector<FileRecord>> SqlJobStore::Files(std::string_view id) {
  return AnswerOf(id, [&](SqlSession& sql) { return SelectFiles(sql, id); });
}

absl::StatusOr<std::optional<FileRecord>> SqlJobStore::File(std::string_view id, FileRole role,
                                                            std::string_view name) {
  return AnswerOf(id, [&](SqlSession& sql) { return SelectFile(sql, id, role, name); });
}

absl::StatusOr<FileTally> SqlJobStore::Tally(std::string_view id, std::string_view sha256) {
  return Answer([&](SqlSession& sql) -> absl::StatusOr<FileTally> {
    LITAGS_ASSIGN_OR_RETURN(const JobRecord job, SelectJob(sql, id));
    return SelectTally(sql, id, job.photos, sha256);
  });
}

absl::StatusOr<std::optional<JobFile>> SqlJobStore::FindFile(std::string_view id, FileRole role,
                                                             std::string_view sha256) {
  return AnswerOf(id, [&](SqlSession& sql) { return SelectSameFile(sql, id, role, sha256); });
}

absl::StatusOr<std::vector<EventRecord>> SqlJobStore::Events(std::string_view id, int64_t after,
                                                             int limit) {
  return AnswerOf(id, [&](SqlSession& sql) { return SelectEvents(sql, id, after, limit); });
}

absl::StatusOr<std::vector<LogEntry>> SqlJobStore::Log(std::string_view id, int64_t after,
                                                       int limit) {
  return AnswerOf(id, [&](SqlSession& sql) { return SelectLog(sql, id, after, limit); });
}

absl::StatusOr<std::string> SqlJobStore::InstallationId() {
  std::string id;
  LITAGS_RETURN_IF_ERROR(Write([&](SqlSession& sql) -> absl::StatusOr<bool> {
    LITAGS_ASSIGN_OR_RETURN(id, InsertInstallation(sql, RandomHex(16)));
    return true;
  }));
  return id;
}

}  // namespace litags
