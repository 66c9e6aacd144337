#include "server/store/sql_job_store.h"

#include "engine/core/error.h"
#include "server/store/digest.h"
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
      return MakeError(absl::StatusCode::kUnavailable, "STORE_BUSY", "request_id",
                       "the other job of this request_id was deleted just now; try again");
    }
    result = *std::move(first);
    return false;
  }));
  return result;
}

absl::StatusOr<JobRecord> SqlJobStore::Get(std::string_view id) {
  JobRecord job;
  LITAGS_RETURN_IF_ERROR(Read([&](SqlSession& sql) -> absl::Status {
    LITAGS_ASSIGN_OR_RETURN(job, SelectJob(sql, id));
    return absl::OkStatus();
  }));
  return job;
}

absl::StatusOr<std::vector<JobRecord>> SqlJobStore::List(int64_t after_time_ms,
                                                         std::string_view after_id, int limit,
                                                         const std::optional<std::string>& owner,
                                                         ListOrder order) {
  std::vector<JobRecord> jobs;
  LITAGS_RETURN_IF_ERROR(Read([&](SqlSession& sql) -> absl::Status {
    LITAGS_ASSIGN_OR_RETURN(jobs, SelectPage(sql, after_time_ms, after_id, limit, owner, order));
    return absl::OkStatus();
  }));
  return jobs;
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
  std::vector<std::string> ids;
  LITAGS_RETURN_IF_ERROR(Read([&](SqlSession& sql) -> absl::Status {
    LITAGS_ASSIGN_OR_RETURN(ids, SelectLeasedTo(sql, owner));
    return absl::OkStatus();
  }));
  return ids;
}

absl::StatusOr<std::vector<std::string>> SqlJobStore::Expired(int64_t now_ms, int limit) {
  std::vector<std::string> ids;
  LITAGS_RETURN_IF_ERROR(Read([&](SqlSession& sql) -> absl::Status {
    LITAGS_ASSIGN_OR_RETURN(ids, SelectExpired(sql, now_ms, limit));
    return absl::OkStatus();
  }));
  return ids;
}

absl::StatusOr<std::vector<std::string>> SqlJobStore::WebhooksDue(int64_t now_ms, int limit) {
  std::vector<std::string> ids;
  LITAGS_RETURN_IF_ERROR(Read([&](SqlSession& sql) -> absl::Status {
    LITAGS_ASSIGN_OR_RETURN(ids, SelectWebhooksDue(sql, now_ms, limit));
    return absl::OkStatus();
  }));
  return ids;
}

absl::StatusOr<std::vector<std::string>> SqlJobStore::JobsWithUnreferencedBlobs(int limit) {
  std::vector<std::string> ids;
  LITAGS_RETURN_IF_ERROR(Read([&](SqlSession& sql) -> absl::Status {
    LITAGS_ASSIGN_OR_RETURN(ids, SelectJobsWithUnreferencedBlobs(sql, limit));
    return absl::OkStatus();
  }));
  return ids;
}

absl::StatusOr<JobCensus> SqlJobStore::Census() {
  JobCensus census;
  LITAGS_RETURN_IF_ERROR(Read([&](SqlSession& sql) -> absl::Status {
    LITAGS_ASSIGN_OR_RETURN(census, SelectCensus(sql));
    return absl::OkStatus();
  }));
  return census;
}

absl::StatusOr<JobQueue> SqlJobStore::Queue() {
  JobQueue queue;
  LITAGS_RETURN_IF_ERROR(Read([&](SqlSession& sql) -> absl::Status {
    LITAGS_ASSIGN_OR_RETURN(queue, SelectQueue(sql));
    return absl::OkStatus();
  }));
  return queue;
}

absl::StatusOr<OwnerUsage> SqlJobStore::UsageOf(std::string_view owner) {
  OwnerUsage usage;
  LITAGS_RETURN_IF_ERROR(Read([&](SqlSession& sql) -> absl::Status {
    LITAGS_ASSIGN_OR_RETURN(usage, SelectUsage(sql, owner, /*but=*/""));
    return absl::OkStatus();
  }));
  return usage;
}

absl::StatusOr<std::vector<std::string>> SqlJobStore::Uploading(std::string_view owner) {
  std::vector<std::string> ids;
  LITAGS_RETURN_IF_ERROR(Read([&](SqlSession& sql) -> absl::Status {
    LITAGS_ASSIGN_OR_RETURN(ids, SelectUploading(sql, owner));
    return absl::OkStatus();
  }));
  return ids;
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
  std::vector<WorkerRecord> workers;
  LITAGS_RETURN_IF_ERROR(Read([&](SqlSession& sql) -> absl::Status {
    LITAGS_ASSIGN_OR_RETURN(workers, SelectWorkers(sql, since_ms));
    return absl::OkStatus();
  }));
  return workers;
}

absl::StatusOr<std::vector<FileRecord>> SqlJobStore::Files(std::string_view id) {
  std::vector<FileRecord> files;
  LITAGS_RETURN_IF_ERROR(Read([&](SqlSession& sql) -> absl::Status {
    LITAGS_RETURN_IF_ERROR(SelectJob(sql, id).status());
    LITAGS_ASSIGN_OR_RETURN(files, SelectFiles(sql, id));
    return absl::OkStatus();
  }));
  return files;
}

absl::StatusOr<std::optional<JobFile>> SqlJobStore::FindFile(std::string_view id, FileRole role,
                                                             std::string_view sha256) {
  std::optional<JobFile> file;
  LITAGS_RETURN_IF_ERROR(Read([&](SqlSession& sql) -> absl::Status {
    LITAGS_RETURN_IF_ERROR(SelectJob(sql, id).status());
    LITAGS_ASSIGN_OR_RETURN(file, SelectSameFile(sql, id, role, sha256));
    return absl::OkStatus();
  }));
  return file;
}

absl::StatusOr<std::vector<EventRecord>> SqlJobStore::Events(std::string_view id, int64_t after,
                                                             int limit) {
  std::vector<EventRecord> events;
  LITAGS_RETURN_IF_ERROR(Read([&](SqlSession& sql) -> absl::Status {
    LITAGS_RETURN_IF_ERROR(SelectJob(sql, id).status());
    LITAGS_ASSIGN_OR_RETURN(events, SelectEvents(sql, id, after, limit));
    return absl::OkStatus();
  }));
  return events;
}

absl::StatusOr<std::vector<LogEntry>> SqlJobStore::Log(std::string_view id, int64_t after,
                                                       int limit) {
  std::vector<LogEntry> entries;
  LITAGS_RETURN_IF_ERROR(Read([&](SqlSession& sql) -> absl::Status {
    LITAGS_RETURN_IF_ERROR(SelectJob(sql, id).status());
    LITAGS_ASSIGN_OR_RETURN(entries, SelectLog(sql, id, after, limit));
    return absl::OkStatus();
  }));
  return entries;
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
