#include "server/store/sql_jobs.h"

#include <algorithm>
#include <limits>
#include <type_traits>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "server/store/sql_files.h"

namespace litags {
namespace {

// Whether an UPDATE writes a column.
enum class Column { kFixed, kChanges };

// Calls f(name, kind, field) for every column of jobs; the one list of them.
template <typename Record, typename F>
void VisitColumns(Record& job, F&& f) {
  f("id", Column::kFixed, job.id);
  f("owner", Column::kFixed, job.owner);
  f("request_id", Column::kFixed, job.request_id);
  f("request_digest", Column::kFixed, job.request_digest);
  f("content_digest", Column::kFixed, job.content_digest);
  f("create_time_ms", Column::kFixed, job.create_time_ms);
  f("display_name", Column::kChanges, job.display_name);
  f("labels", Column::kChanges, job.labels);
  f("clone_source", Column::kChanges, job.clone_source);
  f("start_request_id", Column::kChanges, job.start_request_id);
  f("state", Column::kChanges, job.state);
  f("cancel_requested", Column::kChanges, job.cancel_requested);
  f("attempt", Column::kChanges, job.attempt);
  f("priority", Column::kChanges, job.priority);
  f("needs", Column::kChanges, job.needs);
  f("lease_owner", Column::kChanges, job.lease_owner);
  f("lease_start_ms", Column::kChanges, job.lease_start_ms);
  f("lease_expires_ms", Column::kChanges, job.lease_expires_ms);
  f("run_ms", Column::kChanges, job.run_ms);
  f("start_time_ms", Column::kChanges, job.start_time_ms);
  f("end_time_ms", Column::kChanges, job.end_time_ms);
  f("queue_time_ms", Column::kChanges, job.queue_time_ms);
  f("expire_time_ms", Column::kChanges, job.expire_time_ms);
  f("webhook", Column::kChanges, job.webhook);
  f("webhook_due_ms", Column::kChanges, job.webhook_due_ms);
  f("last_event", Column::kChanges, job.last_event);
  f("last_log_entry", Column::kChanges, job.last_log_entry);
  f("log_bytes", Column::kChanges, job.log_bytes);
  f("photos", Column::kChanges, job.photos);
  f("bytes", Column::kChanges, job.bytes);
  f("snapshot_iteration", Column::kChanges, job.snapshot_iteration);
  f("has_litter", Column::kChanges, job.has_unreferenced_blobs);
  f("litter_bytes", Column::kChanges, job.unreferenced_bytes);
  f("kept_bytes", Column::kChanges, job.kept_bytes);
  f("preview_bytes", Column::kChanges, job.preview_bytes);
  f("kept", Column::kChanges, job.kept);
  f("options", Column::kChanges, job.options);
  f("policy", Column::kChanges, job.policy);
  f("progress", Column::kChanges, job.progress);
  f("error", Column::kChanges, job.error);
  f("report", Column::kChanges, job.report);
}

const std::string& Columns() {
  static const std::string kColumns = [] {
    std::string names;
    const JobRecord job;
    VisitColumns(job, [&](const char* name, Column, const auto&) {
      absl::StrAppend(&names, names.empty() ? "" : ", ", name);
    });
    return names;
  }();
  return kColumns;
}

void BindField(SqlStatement& statement, const std::string& field) { statement.Bind(field); }
template <typename Number>
void BindField(SqlStatement& statement, const Number& field) {
  statement.Bind(static_cast<int64_t>(field));
}

// Of a row of Columns().
JobRecord ReadJob(const SqlStatement& row) {
  JobRecord job;
  int column = 0;
  VisitColumns(job, [&](const char*, Column, auto& field) {
    using Field = std::decay_t<decltype(field)>;
    if constexpr (std::is_same_v<Field, std::string>) {
      field = row.Text(column++);
    } else {
      field = static_cast<Field>(row.Int(column++));
    }
  });
  return job;
}

absl::Status UpdateJob(SqlSession& sql, const JobRecord& job) {
  static const std::string kSql = [] {
    std::string text = "UPDATE jobs SET";
    int parameter = 1;  // the first is the id
    const JobRecord any;
    VisitColumns(any, [&](const char* name, Column kind, const auto&) {
      if (kind == Column::kFixed) return;
      absl::StrAppend(&text, parameter == 1 ? " " : ", ", name, "=?", parameter + 1);
      ++parameter;
    });
    return text + " WHERE id=?1";
  }();
  const auto update = sql.Prepare(kSql);
  update->Bind(job.id);
  VisitColumns(job, [&](const char*, Column kind, const auto& field) {
    if (kind == Column::kChanges) BindField(*update, field);
  });
  return update->Run().status();
}

std::string ReadId(const SqlStatement& row) { return row.Text(0); }

class SqlJobTransaction : public JobTransaction {
 public:
  SqlJobTransaction(SqlSession& sql, JobRecord record)
      : sql_(sql),
        id_(record.id),
        owner_(record.owner),
        was_queued_(record.state == JobState::kQueued),
        said_(record.last_event + record.last_log_entry),
        photos_(record.photos),
        bytes_(record.bytes) {
    job = std::move(record);
  }

  absl::StatusOr<std::vector<FileRecord>> Files() override { return SelectFiles(sql_, id_); }
  absl::StatusOr<std::optional<FileRecord>> File(FileRole role, std::string_view name) override {
    return SelectFile(sql_, id_, role, name);
  }
  absl::StatusOr<FileTally> Tally(std::string_view sha256) override {
    return SelectTally(sql_, id_, photos_, sha256);
  }

  // From here: the job's row is written at the end.
  int64_t Bytes() const override {
    return bytes_ + job.unreferenced_bytes + job.kept_bytes + job.preview_bytes;
  }

  absl::StatusOr<OwnerUsage> Usage() override {
    LITAGS_RETURN_IF_ERROR(sql_.LockOwner(owner_));
    LITAGS_ASSIGN_OR_RETURN(const OwnerUsage others, SelectUsage(sql_, owner_, id_));
    return OwnerUsage{others.jobs + 1, others.bytes + Bytes()};
  }

  absl::Status PutFile(const FileRecord& file) override {
    LITAGS_ASSIGN_OR_RETURN(const auto old, File(file.role, file.name));
    LITAGS_RETURN_IF_ERROR(UpsertFile(sql_, id_, file));
    if (old) Count(*old, -1);
    Count(file, 1);
    return absl::OkStatus();
  }

  absl::Status RemoveFile(FileRole role, std::string_view name) override {
    LITAGS_ASSIGN_OR_RETURN(const auto old, File(role, name));
    if (!old) return absl::OkStatus();
    LITAGS_RETURN_IF_ERROR(DeleteFile(sql_, id_, role, name));
    Count(*old, -1);
    return absl::OkStatus();
  }

  absl::Status RemoveFiles(FileRole role) override {
    LITAGS_ASSIGN_OR_RETURN(const auto files, SelectFilesOf(sql_, id_, role));
    for (const FileRecord& file : files) LITAGS_RETURN_IF_ERROR(RemoveFile(role, file.name));
    return absl::OkStatus();
  }

  absl::Status AddEvent(const EventRecord& event) override {
    const auto insert = sql_.Prepare(
        "INSERT INTO events (job_id, number, time_ms, kind, payload) VALUES (?1,?2,?3,?4,?5)");
    insert->Bind(id_)
        .Bind(++job.last_event)
        .Bind(event.time_ms)
        .Bind(static_cast<int64_t>(event.kind))
        .Bind(event.payload);
    return insert->Run().status();
  }

  absl::Status AddLog(const LogEntry& entry) override {
    const auto insert = sql_.Prepare(
        "INSERT INTO log_entries (job_id, number, time_ms, severity, text) VALUES "
        "(?1,?2,?3,?4,?5)");
    insert->Bind(id_)
        .Bind(++job.last_log_entry)
        .Bind(entry.time_ms)
        .Bind(static_cast<int64_t>(entry.severity))
        .Bind(entry.text);
    job.log_bytes += static_cast<int64_t>(entry.text.size());
    return insert->Run().status();
  }

  absl::Status Remove() override {
    removed_ = true;
    sql_.UseReserve();
    const auto remove = sql_.Prepare("DELETE FROM jobs WHERE id=?1");  // cascades
    remove->Bind(id_);
    return remove->Run().status();
  }

  // Writes `job` back and returns it.
  absl::StatusOr<JobRecord> Finish() {
    job.id = id_;
    job.owner = owner_;
    job.photos = photos_;
    job.bytes = bytes_;
    if (!removed_) LITAGS_RETURN_IF_ERROR(UpdateJob(sql_, job));
    if (removed_ || job.last_event + job.last_log_entry != said_) {
      sql_.Announce(ChangeTopic::kJobs);
    }
    if (job.state == JobState::kQueued && !was_queued_) sql_.Announce(ChangeTopic::kQueue);
    return job;
  }

 private:
  void Count(const FileRecord& file, int64_t sign) {
    bytes_ += sign * file.size_bytes;
    if (file.role == FileRole::kPhoto) photos_ += sign;
  }

  SqlSession& sql_;
  const std::string id_, owner_;
  const bool was_queued_;
  const int64_t said_;  // events and entries of the log
  int64_t photos_, bytes_;
  bool removed_ = false;
};

}  // namespace

absl::Status JobNotFound(std::string_view id) {
  return MakeError(
      absl::StatusCode::kNotFound, "JOB_NOT_FOUND", "name",
      absl::StrCat("there is no job jobs/", std::string(id), "; ListJobs names those there are"));
}

absl::StatusOr<JobRecord> SelectJob(SqlSession& sql, std::string_view id, std::string_view lock) {
  const auto row =
      sql.Prepare(absl::StrCat("SELECT ", Columns(), " FROM jobs WHERE id=?1", std::string(lock)));
  row->Bind(id);
  LITAGS_ASSIGN_OR_RETURN(const bool found, row->Step());
  if (!found) return JobNotFound(id);
  return ReadJob(*row);
}

absl::StatusOr<std::optional<JobRecord>> SelectByRequest(SqlSession& sql, const std::string& owner,
                                                         const std::string& request_id) {
  // The first condition is the index's own.
  const auto row = sql.Prepare(absl::StrCat("SELECT ", Columns(),
                                            " FROM jobs WHERE request_id<>'' AND owner=?1 AND "
                                            "request_id=?2"));
  row->Bind(owner).Bind(request_id);
  LITAGS_ASSIGN_OR_RETURN(const bool found, row->Step());
  if (!found) return std::nullopt;
  return ReadJob(*row);
}

absl::StatusOr<std::vector<JobRecord>> SelectPage(SqlSession& sql, int64_t after_time_ms,
                                                  std::string_view after_id, int limit,
                                                  const std::optional<std::string>& owner,
                                                  ListOrder order) {
  // A text for each case, so that each begins in its index where the page does.
  const bool newest = order == ListOrder::kNewestFirst;
  if (after_time_ms == 0 && newest) after_time_ms = std::numeric_limits<int64_t>::max();
  const char* const direction = newest ? " DESC" : "";
  const auto row = sql.Prepare(absl::StrCat("SELECT ", Columns(), " FROM jobs WHERE ",
                                            owner ? "owner=?4 AND " : "", "(create_time_ms, id) ",
                                            newest ? "<" : ">", " (?1, ?2) ORDER BY create_time_ms",
                                            direction, ", id", direction, " LIMIT ?3"));
  row->Bind(after_time_ms).Bind(after_id).Bind(int64_t{limit});
  if (owner) row->Bind(*owner);
  return ReadAll(*row, ReadJob);
}

absl::StatusOr<std::optional<std::string>> SelectFirst(SqlSession& sql, FirstOf which,
                                                       int64_t time_ms, std::string_view lock) {
  const char* condition = "";
  switch (which) {
    case FirstOf::kExpired:
      condition = "state=3 AND lease_expires_ms < ?1";
      break;
    case FirstOf::kLeasedBeyond:
      condition = "state=3 AND lease_expires_ms > ?1";
      break;
  }
  const auto row = sql.Prepare(
      absl::StrCat("SELECT id FROM jobs WHERE ", condition, " LIMIT 1", std::string(lock)));
  row->Bind(time_ms);
  LITAGS_ASSIGN_OR_RETURN(const bool found, row->Step());
  if (!found) return std::nullopt;
  return row->Text(0);
}

absl::StatusOr<std::vector<std::string>> SelectLeasedTo(SqlSession& sql, std::string_view owner) {
  const auto row = sql.Prepare("SELECT id FROM jobs WHERE state=3 AND lease_owner=?1");
  row->Bind(owner);
  return ReadAll(*row, ReadId);
}

absl::StatusOr<std::vector<std::string>> SelectExpired(SqlSession& sql, int64_t now_ms, int limit) {
  const auto row = sql.Prepare(
      "SELECT id FROM jobs WHERE expire_time_ms > 0 AND expire_time_ms <= ?1 "
      "ORDER BY expire_time_ms LIMIT ?2");
  row->Bind(now_ms).Bind(int64_t{limit});
  return ReadAll(*row, ReadId);
}

absl::StatusOr<std::vector<std::string>> SelectWebhooksDue(SqlSession& sql, int64_t now_ms,
                                                           int64_t latest_ms, int limit) {
  const auto row = sql.Prepare(
      "SELECT id FROM (SELECT id, webhook_due_ms, ROW_NUMBER() OVER "
      "(PARTITION BY owner ORDER BY webhook_due_ms, id) AS place FROM jobs "
      "WHERE webhook_due_ms > 0 AND (webhook_due_ms <= ?1 OR webhook_due_ms > ?2)) AS due "
      "WHERE place = 1 ORDER BY webhook_due_ms LIMIT ?3");
  row->Bind(now_ms).Bind(latest_ms).Bind(int64_t{limit});
  return ReadAll(*row, ReadId);
}

absl::StatusOr<std::vector<std::string>> SelectJobsWithUnreferencedBlobs(SqlSession& sql,
                                                                         int limit) {
  const auto row = sql.Prepare(
      "SELECT id FROM jobs WHERE has_litter=1 AND state NOT IN (1, 2, 3) ORDER BY id LIMIT ?1");
  row->Bind(int64_t{limit});
  return ReadAll(*row, ReadId);
}

absl::StatusOr<OwnerUsage> SelectUsage(SqlSession& sql, std::string_view owner,
                                       std::string_view but) {
  const auto row = sql.Prepare(
      "SELECT COUNT(*), COALESCE(SUM(bytes + litter_bytes + kept_bytes + preview_bytes), 0) "
      "FROM jobs WHERE owner=?1 AND id<>?2");
  row->Bind(std::string(owner)).Bind(std::string(but));
  LITAGS_RETURN_IF_ERROR(row->Step().status());
  return OwnerUsage{row->Int(0), row->Int(1)};
}

absl::StatusOr<std::vector<std::string>> SelectUploading(SqlSession& sql, std::string_view owner) {
  const auto row = sql.Prepare("SELECT id FROM jobs WHERE owner=?1 AND state=1");
  row->Bind(std::string(owner));
  return ReadAll(*row, ReadId);
}

absl::StatusOr<JobCensus> SelectCensus(SqlSession& sql) {
  // Three texts, so that each uses its index.
  JobCensus census;
  const auto at_rest =
      sql.Prepare("SELECT state, COUNT(*) FROM jobs WHERE state NOT IN (2, 3) GROUP BY state");
  for (;;) {
    LITAGS_ASSIGN_OR_RETURN(const bool more, at_rest->Step());
    if (!more) break;
    census.by_state[static_cast<JobState>(at_rest->Int(0))] = at_rest->Int(1);
  }
  const auto queued = sql.Prepare(
      "SELECT needs, COUNT(*), MIN(queue_time_ms) FROM jobs WHERE state=2 GROUP BY needs");
  for (;;) {
    LITAGS_ASSIGN_OR_RETURN(const bool more, queued->Step());
    if (!more) break;
    census.queued_by_needs[queued->Text(0)] = queued->Int(1);
    census.by_state[JobState::kQueued] += queued->Int(1);
    int64_t& oldest_ms = census.oldest_queue_time_ms;
    oldest_ms = oldest_ms == 0 ? queued->Int(2) : std::min(oldest_ms, queued->Int(2));
  }
  const auto running = sql.Prepare("SELECT progress FROM jobs WHERE state=3");
  for (;;) {
    LITAGS_ASSIGN_OR_RETURN(const bool more, running->Step());
    if (!more) return census;
    ++census.by_state[JobState::kRunning];
    census.running_progress.push_back(running->Text(0));
  }
}

absl::StatusOr<JobQueue> SelectQueue(SqlSession& sql) {
  JobQueue queue;
  const auto waiting = sql.Prepare(
      "SELECT id, owner, priority, queue_time_ms FROM jobs WHERE state=2 "
      "ORDER BY priority DESC, queue_time_ms, create_time_ms, id");
  LITAGS_ASSIGN_OR_RETURN(
      queue.waiting, ReadAll(*waiting, [](const SqlStatement& row) {
        return JobQueue::Job{row.Text(0), row.Text(1), static_cast<int>(row.Int(2)), row.Int(3)};
      }));
  const auto running = sql.Prepare("SELECT owner, COUNT(*) FROM jobs WHERE state=3 GROUP BY owner");
  for (;;) {
    LITAGS_ASSIGN_OR_RETURN(const bool more, running->Step());
    if (!more) return queue;
    queue.running[running->Text(0)] = running->Int(1);
  }
}

absl::StatusOr<std::vector<EventRecord>> SelectEvents(SqlSession& sql, std::string_view id,
                                                      int64_t after, int limit) {
  const auto row = sql.Prepare(
      "SELECT number, time_ms, kind, payload FROM events WHERE job_id=?1 AND number>?2 "
      "ORDER BY number LIMIT ?3");
  row->Bind(id).Bind(after).Bind(int64_t{limit});
  return ReadAll(*row, [](const SqlStatement& event) {
    return EventRecord{event.Int(0), event.Int(1), static_cast<EventKind>(event.Int(2)),
                       event.Text(3)};
  });
}

absl::StatusOr<std::vector<LogEntry>> SelectLog(SqlSession& sql, std::string_view id, int64_t after,
                                                int limit) {
  const auto row = sql.Prepare(
      "SELECT number, time_ms, severity, text FROM log_entries WHERE job_id=?1 AND number>?2 "
      "ORDER BY number LIMIT ?3");
  row->Bind(id).Bind(after).Bind(int64_t{limit});
  return ReadAll(*row, [](const SqlStatement& entry) {
    return LogEntry{entry.Int(0), entry.Int(1), static_cast<LogSeverity>(entry.Int(2)),
                    entry.Text(3)};
  });
}

absl::StatusOr<bool> InsertJob(SqlSession& sql, const JobRecord& job) {
  static const std::string kSql = [] {
    std::string values;
    int parameter = 0;
    const JobRecord any;
    VisitColumns(any, [&](const char*, Column, const auto&) {
      absl::StrAppend(&values, parameter == 0 ? "?" : ",?", parameter + 1);
      ++parameter;
    });
    return absl::StrCat("INSERT INTO jobs (", Columns(), ") VALUES (", values,
                        ") ON CONFLICT (owner, request_id) WHERE request_id <> '' DO NOTHING");
  }();
  const auto insert = sql.Prepare(kSql);
  VisitColumns(job, [&](const char*, Column, const auto& field) { BindField(*insert, field); });
  LITAGS_ASSIGN_OR_RETURN(const int64_t inserted, insert->Run());
  return inserted == 1;
}

absl::StatusOr<std::string> InsertInstallation(SqlSession& sql, std::string_view id) {
  const auto insert = sql.Prepare(
      "INSERT INTO installation (number, id) VALUES (1, ?1) ON CONFLICT (number) DO NOTHING");
  insert->Bind(id);
  LITAGS_RETURN_IF_ERROR(insert->Run().status());
  const auto row = sql.Prepare("SELECT id FROM installation");
  LITAGS_RETURN_IF_ERROR(row->Step().status());
  return row->Text(0);
}

absl::StatusOr<JobRecord> ApplyChange(SqlSession& sql, JobRecord job, JobStore::Change change) {
  SqlJobTransaction transaction(sql, std::move(job));
  LITAGS_RETURN_IF_ERROR(change(transaction));
  return transaction.Finish();
}

}  // namespace litags
