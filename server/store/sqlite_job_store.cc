#include <filesystem>
#include <mutex>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "server/store/job_store.h"
#include "server/store/sqlite.h"
#include "server/store/sqlite_migrations.h"

namespace litags {
namespace {

constexpr char kColumns[] =
    "id, request_id, display_name, state, cancel_requested, attempt, lease_owner, "
    "lease_expires_ms, create_time_ms, start_time_ms, end_time_ms, queue_time_ms, last_event, "
    "photos, bytes, snapshot_iteration, scene_path, options, progress, error, report, "
    "owner, content_digest, priority, lease_start_ms, run_ms, expire_time_ms, policy";

const std::string kSelect = absl::StrCat("SELECT ", kColumns, " FROM jobs ");

// Order as kColumns.
JobRecord ReadJob(const Statement& row) {
  JobRecord job;
  int c = 0;
  job.id = row.Text(c++);
  job.request_id = row.Text(c++);
  job.display_name = row.Text(c++);
  job.state = static_cast<JobState>(row.Int(c++));
  job.cancel_requested = row.Int(c++) != 0;
  job.attempt = static_cast<int>(row.Int(c++));
  job.lease_owner = row.Text(c++);
  job.lease_expires_ms = row.Int(c++);
  job.create_time_ms = row.Int(c++);
  job.start_time_ms = row.Int(c++);
  job.end_time_ms = row.Int(c++);
  job.queue_time_ms = row.Int(c++);
  job.last_event = row.Int(c++);
  job.photos = row.Int(c++);
  job.bytes = row.Int(c++);
  job.snapshot_iteration = static_cast<int>(row.Int(c++));
  job.scene_path = row.Text(c++);
  job.options = row.Text(c++);
  job.progress = row.Text(c++);
  job.error = row.Text(c++);
  job.report = row.Text(c++);
  job.owner = row.Text(c++);
  job.content_digest = row.Text(c++);
  job.priority = static_cast<int>(row.Int(c++));
  job.lease_start_ms = row.Int(c++);
  job.run_ms = row.Int(c++);
  job.expire_time_ms = row.Int(c++);
  job.policy = row.Text(c++);
  return job;
}

// Order as kColumns; writes the whole row, new or not.
absl::Status WriteJob(SqliteConnection* db, const JobRecord& job) {
  static const std::string kUpsert = [] {
    std::string sql = absl::StrCat("INSERT INTO jobs (", kColumns, ") VALUES (?");
    const auto columns = std::count(std::begin(kColumns), std::end(kColumns), ',');
    for (auto i = 0; i < columns; ++i) sql += ",?";
    // Not INSERT OR REPLACE, which would delete the row and with it the files and events.
    sql += ") ON CONFLICT (id) DO UPDATE SET ";
    for (const char* name : {"display_name",
                             "state",
                             "cancel_requested",
                             "attempt",
                             "lease_owner",
                             "lease_expires_ms",
                             "start_time_ms",
                             "end_time_ms",
                             "queue_time_ms",
                             "last_event",
                             "photos",
                             "bytes",
                             "snapshot_iteration",
                             "scene_path",
                             "options",
                             "progress",
                             "error",
                             "report",
                             "priority",
                             "lease_start_ms",
                             "run_ms",
                             "expire_time_ms",
                             "policy"}) {
      absl::StrAppend(&sql, sql.back() == ' ' ? "" : ", ", name, "=excluded.", name);
    }
    return sql;
  }();
  Statement statement = db->Prepare(kUpsert);
  statement.Bind(job.id)
      .Bind(job.request_id)
      .Bind(job.display_name)
      .Bind(static_cast<int64_t>(job.state))
      .Bind(int64_t{job.cancel_requested})
      .Bind(int64_t{job.attempt})
      .Bind(job.lease_owner)
      .Bind(job.lease_expires_ms)
      .Bind(job.create_time_ms)
      .Bind(job.start_time_ms)
      .Bind(job.end_time_ms)
      .Bind(job.queue_time_ms)
      .Bind(job.last_event)
      .Bind(job.photos)
      .Bind(job.bytes)
      .Bind(int64_t{job.snapshot_iteration})
      .Bind(job.scene_path)
      .Bind(job.options)
      .Bind(job.progress)
      .Bind(job.error)
      .Bind(job.report)
      .Bind(job.owner)
      .Bind(job.content_digest)
      .Bind(int64_t{job.priority})
      .Bind(job.lease_start_ms)
      .Bind(job.run_ms)
      .Bind(job.expire_time_ms)
      .Bind(job.policy);
  return statement.Run();
}

constexpr char kFileColumns[] = "role, name, size_bytes, sha256, width, height";

// Order as kFileColumns.
FileRecord ReadFileRow(const Statement& row) {
  FileRecord file;
  int c = 0;
  file.role = static_cast<FileRole>(row.Int(c++));
  file.name = row.Text(c++);
  file.size_bytes = row.Int(c++);
  file.sha256 = row.Text(c++);
  file.width = static_cast<int>(row.Int(c++));
  file.height = static_cast<int>(row.Int(c++));
  return file;
}

absl::StatusOr<std::vector<FileRecord>> SelectFiles(SqliteConnection* db, std::string_view id) {
  static const std::string kSql =
      absl::StrCat("SELECT ", kFileColumns, " FROM files WHERE job_id=? ORDER BY role, name");
  Statement row = db->Prepare(kSql);
  row.Bind(id);
  std::vector<FileRecord> files;
  for (;;) {
    LITAGS_ASSIGN_OR_RETURN(const bool more, row.Step());
    if (!more) return files;
    files.push_back(ReadFileRow(row));
  }
}

// The ids that a prepared SELECT gives.
absl::StatusOr<std::vector<std::string>> ReadIds(Statement& row) {
  std::vector<std::string> ids;
  for (;;) {
    LITAGS_ASSIGN_OR_RETURN(const bool more, row.Step());
    if (!more) return ids;
    ids.push_back(row.Text(0));
  }
}

class SqliteJobTransaction : public JobTransaction {
 public:
  SqliteJobTransaction(SqliteConnection* db, JobRecord record)
      : db_(db),
        id_(record.id),
        owner_(record.owner),
        photos_(record.photos),
        bytes_(record.bytes) {
    job = std::move(record);
  }

  absl::StatusOr<std::vector<FileRecord>> Files() override { return SelectFiles(db_, id_); }

  absl::StatusOr<OwnerUsage> Usage() override {
    // This job's row is written at the end: its bytes are counted from here.
    Statement row = db_->Prepare("SELECT COUNT(*), SUM(bytes) FROM jobs WHERE owner=? AND id<>?");
    row.Bind(owner_).Bind(id_);
    LITAGS_RETURN_IF_ERROR(row.Run());
    return OwnerUsage{row.Int(0) + 1, row.Int(1) + bytes_};
  }

  absl::Status PutFile(const FileRecord& file) override {
    {
      Statement insert = db_->Prepare(
          "INSERT OR REPLACE INTO files (job_id, role, name, size_bytes, sha256, width, height) "
          "VALUES (?,?,?,?,?,?,?)");
      insert.Bind(id_)
          .Bind(static_cast<int64_t>(file.role))
          .Bind(file.name)
          .Bind(file.size_bytes)
          .Bind(file.sha256)
          .Bind(int64_t{file.width})
          .Bind(int64_t{file.height});
      LITAGS_RETURN_IF_ERROR(insert.Run());
    }
    Statement sums = db_->Prepare(
        "SELECT COUNT(*) FILTER (WHERE role=1), SUM(size_bytes) FROM files WHERE job_id=?");
    sums.Bind(id_);
    LITAGS_RETURN_IF_ERROR(sums.Run());
    photos_ = sums.Int(0);
    bytes_ = sums.Int(1);
    return absl::OkStatus();
  }

  absl::Status AddEvent(const EventRecord& event) override {
    Statement insert = db_->Prepare(
        "INSERT INTO events (job_id, number, time_ms, kind, payload) VALUES (?,?,?,?,?)");
    insert.Bind(id_)
        .Bind(++job.last_event)
        .Bind(event.time_ms)
        .Bind(static_cast<int64_t>(event.kind))
        .Bind(event.payload);
    return insert.Run();
  }

  absl::Status Remove() override {
    removed_ = true;
    Statement remove = db_->Prepare("DELETE FROM jobs WHERE id=?");  // cascades
    remove.Bind(id_);
    return remove.Run();
  }

  // Writes `job` back and returns it.
  absl::StatusOr<JobRecord> Finish() {
    job.id = id_;
    job.owner = owner_;
    job.photos = photos_;
    job.bytes = bytes_;
    if (!removed_) LITAGS_RETURN_IF_ERROR(WriteJob(db_, job));
    return job;
  }

 private:
  SqliteConnection* db_;
  const std::string id_, owner_;
  int64_t photos_, bytes_;
  bool removed_ = false;
};

class SqliteJobStore : public JobStore {
 public:
  explicit SqliteJobStore(std::unique_ptr<SqliteConnection> db) : db_(std::move(db)) {}

  absl::StatusOr<JobRecord> Create(const JobRecord& job, Change change) override {
    std::lock_guard lock(mutex_);
    LITAGS_ASSIGN_OR_RETURN(const auto transaction, SqliteTransaction::Begin(db_.get()));
    if (!job.request_id.empty()) {
      Statement row = db_->Prepare(kSelect + "WHERE owner=? AND request_id=?");
      row.Bind(job.owner).Bind(job.request_id);
      LITAGS_ASSIGN_OR_RETURN(const bool found, row.Step());
      if (found) return ReadJob(row);
    }
    LITAGS_RETURN_IF_ERROR(WriteJob(db_.get(), job));
    return Apply(job, change, transaction.get());
  }

  absl::StatusOr<JobRecord> Get(std::string_view id) override {
    std::lock_guard lock(mutex_);
    return Select(id);
  }

  absl::StatusOr<std::vector<JobRecord>> List(int64_t after_time_ms, std::string_view after_id,
                                              int limit,
                                              const std::optional<std::string>& owner) override {
    std::lock_guard lock(mutex_);
    // Two texts, so that each uses its index.
    Statement row = db_->Prepare(kSelect + (owner ? "WHERE owner=?4 AND " : "WHERE ") +
                                 "(?1=0 OR (create_time_ms, id) < (?1, ?2)) "
                                 "ORDER BY create_time_ms DESC, id DESC LIMIT ?3");
    row.Bind(after_time_ms).Bind(after_id).Bind(int64_t{limit});
    if (owner) row.Bind(*owner);
    std::vector<JobRecord> jobs;
    for (;;) {
      LITAGS_ASSIGN_OR_RETURN(const bool more, row.Step());
      if (!more) return jobs;
      jobs.push_back(ReadJob(row));
    }
  }

  absl::StatusOr<JobRecord> Update(std::string_view id, Change change) override {
    std::lock_guard lock(mutex_);
    LITAGS_ASSIGN_OR_RETURN(const auto transaction, SqliteTransaction::Begin(db_.get()));
    LITAGS_ASSIGN_OR_RETURN(JobRecord job, Select(id));
    return Apply(std::move(job), change, transaction.get());
  }

  absl::StatusOr<std::optional<JobRecord>> UpdateFirstQueued(Change change) override {
    return UpdateFirst(
        "SELECT id FROM jobs WHERE state=2 AND ?1=?1 "
        "ORDER BY priority DESC, queue_time_ms, create_time_ms, id LIMIT 1",
        0, change);
  }

  absl::StatusOr<std::optional<JobRecord>> UpdateFirstExpired(int64_t now_ms,
                                                              Change change) override {
    return UpdateFirst("SELECT id FROM jobs WHERE state=3 AND lease_expires_ms < ?1 LIMIT 1",
                       now_ms, change);
  }

  absl::StatusOr<std::optional<JobRecord>> UpdateFirstLeasedBeyond(int64_t latest_ms,
                                                                   Change change) override {
    return UpdateFirst("SELECT id FROM jobs WHERE state=3 AND lease_expires_ms > ?1 LIMIT 1",
                       latest_ms, change);
  }

  absl::StatusOr<std::vector<std::string>> LeasedTo(std::string_view owner) override {
    std::lock_guard lock(mutex_);
    Statement row = db_->Prepare("SELECT id FROM jobs WHERE state=3 AND lease_owner=?");
    row.Bind(owner);
    return ReadIds(row);
  }

  absl::StatusOr<std::vector<std::string>> Expired(int64_t now_ms, int limit) override {
    std::lock_guard lock(mutex_);
    Statement row = db_->Prepare(
        "SELECT id FROM jobs WHERE expire_time_ms > 0 AND expire_time_ms <= ? "
        "ORDER BY expire_time_ms LIMIT ?");
    row.Bind(now_ms).Bind(int64_t{limit});
    return ReadIds(row);
  }

  absl::StatusOr<std::vector<FileRecord>> Files(std::string_view id) override {
    std::lock_guard lock(mutex_);
    LITAGS_RETURN_IF_ERROR(Select(id).status());
    return SelectFiles(db_.get(), id);
  }

  absl::StatusOr<std::optional<JobFile>> FindFile(std::string_view id, FileRole role,
                                                  std::string_view sha256) override {
    std::lock_guard lock(mutex_);
    LITAGS_RETURN_IF_ERROR(Select(id).status());
    static const std::string kSql =
        absl::StrCat("SELECT ", kFileColumns,
                     ", job_id FROM files WHERE sha256=?1 AND role=?2 AND "
                     "(SELECT owner FROM jobs WHERE id=job_id) = "
                     "(SELECT owner FROM jobs WHERE id=?3) ORDER BY job_id <> ?3 LIMIT 1");
    Statement row = db_->Prepare(kSql);
    row.Bind(sha256).Bind(static_cast<int64_t>(role)).Bind(id);
    LITAGS_ASSIGN_OR_RETURN(const bool found, row.Step());
    if (!found) return std::nullopt;
    return JobFile{row.Text(6), ReadFileRow(row)};
  }

  absl::StatusOr<std::vector<EventRecord>> Events(std::string_view id, int64_t after,
                                                  int limit) override {
    std::lock_guard lock(mutex_);
    LITAGS_RETURN_IF_ERROR(Select(id).status());
    Statement row = db_->Prepare(
        "SELECT number, time_ms, kind, payload FROM events WHERE job_id=? AND number>? "
        "ORDER BY number LIMIT ?");
    row.Bind(id).Bind(after).Bind(int64_t{limit});
    std::vector<EventRecord> events;
    for (;;) {
      LITAGS_ASSIGN_OR_RETURN(const bool more, row.Step());
      if (!more) return events;
      events.push_back({row.Int(0), row.Int(1), static_cast<EventKind>(row.Int(2)), row.Text(3)});
    }
  }

  absl::StatusOr<int64_t> ChangeToken() override {
    std::lock_guard lock(mutex_);
    // data_version moves with other connections' commits only; ours are counted.
    Statement row = db_->Prepare("PRAGMA data_version");
    LITAGS_RETURN_IF_ERROR(row.Run());
    return own_commits_ + row.Int(0);
  }

 private:
  // The private methods run under mutex_.
  absl::StatusOr<JobRecord> Select(std::string_view id) {
    Statement row = db_->Prepare(kSelect + "WHERE id=?");
    row.Bind(id);
    LITAGS_ASSIGN_OR_RETURN(const bool found, row.Step());
    if (!found) return JobNotFound(id);
    return ReadJob(row);
  }

  absl::StatusOr<JobRecord> Apply(JobRecord job, Change change, SqliteTransaction* transaction) {
    SqliteJobTransaction edit(db_.get(), std::move(job));
    LITAGS_RETURN_IF_ERROR(change(edit));
    LITAGS_ASSIGN_OR_RETURN(JobRecord result, edit.Finish());
    LITAGS_RETURN_IF_ERROR(transaction->Commit());
    ++own_commits_;
    return result;
  }

  absl::StatusOr<std::optional<JobRecord>> UpdateFirst(const char* sql, int64_t argument,
                                                       Change change) {
    std::lock_guard lock(mutex_);
    // Most calls find nothing: look before taking the write lock.
    LITAGS_ASSIGN_OR_RETURN(std::string id, FirstId(sql, argument));
    if (id.empty()) return std::nullopt;
    LITAGS_ASSIGN_OR_RETURN(const auto transaction, SqliteTransaction::Begin(db_.get()));
    LITAGS_ASSIGN_OR_RETURN(id, FirstId(sql, argument));
    if (id.empty()) return std::nullopt;
    LITAGS_ASSIGN_OR_RETURN(JobRecord job, Select(id));
    LITAGS_ASSIGN_OR_RETURN(JobRecord result, Apply(std::move(job), change, transaction.get()));
    return result;
  }

  absl::StatusOr<std::string> FirstId(const char* sql, int64_t argument) {
    Statement row = db_->Prepare(sql);
    row.Bind(argument);
    LITAGS_ASSIGN_OR_RETURN(const bool found, row.Step());
    return found ? row.Text(0) : std::string();
  }

  std::mutex mutex_;
  std::unique_ptr<SqliteConnection> db_;
  int64_t own_commits_ = 0;
};

}  // namespace

absl::Status JobNotFound(std::string_view id) {
  return MakeError(
      absl::StatusCode::kNotFound, "JOB_NOT_FOUND", "name",
      absl::StrCat("there is no job jobs/", std::string(id), "; ListJobs names those there are"));
}

absl::StatusOr<std::unique_ptr<JobStore>> OpenSqliteJobStore(const std::string& path) {
  LITAGS_ASSIGN_OR_RETURN(auto connection, SqliteConnection::Open(path));
  LITAGS_RETURN_IF_ERROR(MigrateSqlite(connection.get()));
  return std::unique_ptr<JobStore>(std::make_unique<SqliteJobStore>(std::move(connection)));
}

}  // namespace litags
