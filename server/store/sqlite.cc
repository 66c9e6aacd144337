#include "server/store/sqlite.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"

namespace litags {
namespace {

// SQLite says SQLITE_FULL of its database and log only: not where its shared memory finds no room,
// nor where a quota ends.
bool IsDiskFull(sqlite3* db, int result) {
  if (result == SQLITE_FULL) return true;
  if (result != SQLITE_IOERR && result != SQLITE_CANTOPEN) return false;
  const int error = sqlite3_system_errno(db);
  return error == ENOSPC || error == EDQUOT;
}

absl::Status ErrorOf(sqlite3* db, int result) {
  const std::string text = db ? sqlite3_errmsg(db) : sqlite3_errstr(result);
  if (IsDiskFull(db, result)) {
    return MakeError(absl::StatusCode::kResourceExhausted, "DISK_FULL", "",
                     "the job store's disk is full; free some space and try again");
  }
  if (result == SQLITE_CORRUPT || result == SQLITE_NOTADB) {
    return MakeError(absl::StatusCode::kDataLoss, "STORE_CORRUPT", "",
                     absl::StrCat("the job store is damaged: ", text, "; put back a backup"));
  }
  if (result == SQLITE_BUSY) return StoreBusy(text);
  return MakeError(absl::StatusCode::kInternal, "STORE_FAILED", "",
                   absl::StrCat("the job store failed: ", text));
}

}  // namespace

SqliteStatement::~SqliteStatement() {
  sqlite3_reset(stmt_);
  sqlite3_clear_bindings(stmt_);
}

SqlStatement& SqliteStatement::Bind(int64_t value) {
  const int result = sqlite3_bind_int64(stmt_, next_parameter_++, value);
  if (bind_result_ == SQLITE_OK) bind_result_ = result;
  return *this;
}

SqlStatement& SqliteStatement::Bind(std::string_view value) {
  // A null pointer would bind NULL.
  const char* data = value.data() ? value.data() : "";
  const int result = sqlite3_bind_text(stmt_, next_parameter_++, data,
                                       static_cast<int>(value.size()), SQLITE_TRANSIENT);
  if (bind_result_ == SQLITE_OK) bind_result_ = result;
  return *this;
}

absl::StatusOr<bool> SqliteStatement::Step() {
  if (!stmt_ || bind_result_ != SQLITE_OK) return ErrorOf(db_, bind_result_);
  const int result = sqlite3_step(stmt_);
  if (result == SQLITE_ROW) return true;
  if (result == SQLITE_DONE) return false;
  return ErrorOf(db_, result);
}

absl::StatusOr<int64_t> SqliteStatement::Run() {
  LITAGS_RETURN_IF_ERROR(Step().status());
  return sqlite3_changes64(db_);
}

std::string SqliteStatement::Text(int column) const {
  const auto* text = reinterpret_cast<const char*>(sqlite3_column_text(stmt_, column));
  return text ? std::string(text, sqlite3_column_bytes(stmt_, column)) : std::string();
}

namespace {

// Two that change a new file's mode at the same time are in each other's way, and SQLite does not
// wait then.
absl::Status EnterWal(sqlite3* db, int busy_timeout_ms) {
  constexpr int kPauseMs = 10;
  int result = SQLITE_BUSY;
  for (int waited_ms = 0; result == SQLITE_BUSY && waited_ms < busy_timeout_ms;
       waited_ms += kPauseMs) {
    if (waited_ms > 0) sqlite3_sleep(kPauseMs);
    result = sqlite3_exec(db, "PRAGMA journal_mode=WAL", nullptr, nullptr, nullptr);
  }
  return result == SQLITE_OK ? absl::OkStatus() : ErrorOf(db, result);
}

}  // namespace

absl::StatusOr<std::unique_ptr<SqliteConnection>> SqliteConnection::Open(const std::string& path,
                                                                         int busy_timeout_ms) {
  // A new file is for its owner only, and so are those that SQLite puts beside it. One that is
  // there is not opened: closing it would end the locks of this process's other connections.
  const int fd = open(path.c_str(), O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, 0600);
  if (fd >= 0) close(fd);
  sqlite3* db = nullptr;
  const int flags = SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE | SQLITE_OPEN_NOMUTEX;
  const int result = sqlite3_open_v2(path.c_str(), &db, flags, nullptr);
  std::unique_ptr<SqliteConnection> connection(new SqliteConnection(db));
  if (result != SQLITE_OK) {
    return MakeError(absl::StatusCode::kFailedPrecondition, "STORE_NOT_OPENED", "data",
                     absl::StrCat("cannot open the job store ", path, ": ", sqlite3_errstr(result),
                                  "; check that the folder exists and may be written"));
  }
  sqlite3_busy_timeout(db, busy_timeout_ms);
  LITAGS_RETURN_IF_ERROR(EnterWal(db, busy_timeout_ms));
  // FULL: a commit is on disk before it returns, also in WAL mode.
  LITAGS_RETURN_IF_ERROR(connection->Execute("PRAGMA synchronous=FULL; PRAGMA foreign_keys=ON;"));
  return connection;
}

SqliteConnection::~SqliteConnection() {
  for (auto& [sql, stmt] : statements_) sqlite3_finalize(stmt);
  sqlite3_close(db_);
}

std::unique_ptr<SqlStatement> SqliteConnection::Prepare(const std::string& sql) {
  auto [it, added] = statements_.try_emplace(sql, nullptr);
  if (!it->second) {
    sqlite3_prepare_v3(db_, sql.c_str(), static_cast<int>(sql.size()), SQLITE_PREPARE_PERSISTENT,
                       &it->second, nullptr);
  }
  return std::make_unique<SqliteStatement>(db_, it->second);
}

absl::Status SqliteConnection::Execute(const std::string& sql) {
  const int result = sqlite3_exec(db_, sql.c_str(), nullptr, nullptr, nullptr);
  return result == SQLITE_OK ? absl::OkStatus() : ErrorOf(db_, result);
}

absl::StatusOr<std::unique_ptr<SqliteTransaction>> SqliteTransaction::Begin(
    SqliteConnection* connection) {
  connection->uses_reserve_ = false;
  // IMMEDIATE: takes the write lock now, so that what is read cannot change before the commit.
  LITAGS_RETURN_IF_ERROR(connection->Execute("BEGIN IMMEDIATE"));
  return std::unique_ptr<SqliteTransaction>(new SqliteTransaction(connection));
}

SqliteTransaction::~SqliteTransaction() {
  // A failed COMMIT or a full disk may have rolled back already; the error is of no interest then.
  if (!done_) connection_->Execute("ROLLBACK").IgnoreError();
}

absl::Status SqliteTransaction::Commit() {
  LITAGS_RETURN_IF_ERROR(connection_->Execute("COMMIT"));
  done_ = true;
  return absl::OkStatus();
}

}  // namespace litags
