#include "server/store/postgres.h"

#include <poll.h>
#include <time.h>

#include <algorithm>
#include <cstdlib>
#include <limits>
#include <string_view>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "engine/core/error.h"

namespace litags {
namespace {

constexpr int kOldestServer = 130000;  // pg_xact_status(xid8)
// The server ends a statement itself before the connection is given up.
constexpr int64_t kPatienceMs = kStatementTimeoutMs + 2000;
constexpr char kSessionSettings[] =
    // A transaction whose client is gone, or was cut off, holds its job no longer than this.
    "SET idle_in_transaction_session_timeout = 15000; "
    "SET tcp_keepalives_idle = 5; SET tcp_keepalives_interval = 5; SET tcp_keepalives_count = 2; "
    "SET default_transaction_isolation = 'read committed'; "
    // An OK answer is on disk. Stronger settings are the operator's choice.
    "SELECT set_config('synchronous_commit', 'on', false) "
    "WHERE current_setting('synchronous_commit') = 'off'; "
    // Connections are kept; of version 14 and later.
    "SELECT set_config(name, '0', false) FROM pg_settings WHERE name = 'idle_session_timeout'";

// In the catalogue of PostgreSQL, pg_type.dat; fixed for ever.
constexpr Oid kInt8 = 20, kText = 25;

std::string Trimmed(const char* message) {
  std::string text(absl::StripAsciiWhitespace(message ? message : ""));
  std::replace(text.begin(), text.end(), '\n', ' ');
  return text;
}

bool IsError(const PGresult* result) {
  const ExecStatusType status = PQresultStatus(result);
  return status != PGRES_COMMAND_OK && status != PGRES_TUPLES_OK;
}

}  // namespace

class PgStatement : public SqlStatement {
 public:
  PgStatement(PgConnection* connection, std::string sql)
      : connection_(connection), sql_(std::move(sql)) {}

  SqlStatement& Bind(int64_t value) override {
    types_.push_back(kInt8);
    values_.push_back(absl::StrCat(value));
    return *this;
  }
  SqlStatement& Bind(std::string_view value) override {
    types_.push_back(kText);
    values_.emplace_back(value);
    return *this;
  }

  absl::StatusOr<bool> Step() override {
    if (!result_) LITAGS_RETURN_IF_ERROR(Send());
    return ++row_ < PQntuples(result_.get());
  }

  absl::StatusOr<int64_t> Run() override {
    LITAGS_RETURN_IF_ERROR(Send());
    return std::strtoll(PQcmdTuples(result_.get()), nullptr, 10);
  }

  int64_t Int(int column) const override {
    return std::strtoll(PQgetvalue(result_.get(), row_, column), nullptr, 10);
  }
  std::string Text(int column) const override {
    return std::string(PQgetvalue(result_.get(), row_, column),
                       static_cast<size_t>(PQgetlength(result_.get(), row_, column)));
  }

 private:
  absl::Status Send() {
    for (const std::string& value : values_) {
      if (value.find('\0') == std::string::npos) continue;
      return InvalidInput("TEXT_INVALID", "",
                          "a text holds a NUL character, which PostgreSQL cannot keep; remove it");
    }
    LITAGS_ASSIGN_OR_RETURN(result_, connection_->RunPrepared(sql_, types_, values_));
    return absl::OkStatus();
  }

  PgConnection* const connection_;
  const std::string sql_;
  std::vector<Oid> types_;
  std::vector<std::string> values_;
  PgConnection::Result result_;
  int row_ = -1;
};

const char* ChannelOf(ChangeTopic topic) {
  return topic == ChangeTopic::kQueue ? "litags_queue" : "litags_jobs";
}

int64_t MonotonicMs() {
  timespec now;
  clock_gettime(CLOCK_BOOTTIME, &now);
  return int64_t{now.tv_sec} * 1000 + now.tv_nsec / 1'000'000;
}

absl::Status StoreUnavailable(const std::string& why) {
  return MakeError(absl::StatusCode::kUnavailable, "STORE_UNAVAILABLE", "",
                   absl::StrCat("the job store's database is away: ", why,
                                "; nothing was changed, try again in a moment"));
}

absl::StatusOr<std::unique_ptr<PgConnection>> PgConnection::Open(const std::string& url) {
  // What the URL says comes later, and wins.
  constexpr int kOptions = 10;
  const char* const keywords[kOptions] = {
      "connect_timeout",  "keepalives_idle",  "keepalives_interval",
      "keepalives_count", "tcp_user_timeout", "target_session_attrs",
      "application_name", "client_encoding",  "dbname"};
  const char* const values[kOptions] = {"5",          "5",      "5",    "2",        "10000",
                                        "read-write", "litags", "UTF8", url.c_str()};
  std::unique_ptr<PgConnection> connection(
      new PgConnection(PQconnectdbParams(keywords, values, /*expand_dbname=*/1)));
  PGconn* const pg = connection->connection_;
  if (!pg) return StoreUnavailable("out of memory");
  if (PQstatus(pg) != CONNECTION_OK) {
    std::string why = Trimmed(PQerrorMessage(pg));
    // libpq gives no SQLSTATE (53300) of a connection that was refused.
    if (why.find("too many clients") != std::string::npos ||
        why.find("connection slots are reserved") != std::string::npos) {
      why += "; raise PostgreSQL's max_connections: docs/scaling.md says to what";
    }
    return StoreUnavailable(why);
  }
  if (PQserverVersion(pg) < kOldestServer) {
    return MakeError(absl::StatusCode::kFailedPrecondition, "STORE_TOO_OLD", "store",
                     absl::StrCat("the PostgreSQL server has version ", PQserverVersion(pg) / 10000,
                                  "; version 13 or later is needed"));
  }
  PQsetNoticeProcessor(
      pg, [](void*, const char*) {}, nullptr);  // else it writes to stderr
  if (PQsetnonblocking(pg, 1) != 0) return StoreUnavailable(Trimmed(PQerrorMessage(pg)));
  LITAGS_RETURN_IF_ERROR(connection->SetUp());
  return connection;
}

PgConnection::PgConnection(PGconn* connection)
    : connection_(connection), patience_ms_(kPatienceMs) {}

PgConnection::~PgConnection() { PQfinish(connection_); }

absl::Status PgConnection::SetUp() {
  LITAGS_RETURN_IF_ERROR(Execute(absl::StrCat("SET lock_timeout = ", kLockTimeoutMs,
                                              "; SET statement_timeout = ", kStatementTimeoutMs,
                                              "; ", kSessionSettings)));
  return ReadClock();
}

absl::Status PgConnection::SetStatementTimeout(int ms) {
  LITAGS_RETURN_IF_ERROR(Execute(absl::StrCat("SET statement_timeout = ", ms)));
  // A server that is gone is found out by its silence below TCP.
  patience_ms_ = ms == 0 ? std::numeric_limits<int>::max() : ms + 2000;
  return absl::OkStatus();
}

absl::Status PgConnection::ReadClock() {
  LITAGS_ASSIGN_OR_RETURN(
      const Result result,
      Await(PQsendQuery(connection_,
                        "SELECT (extract(epoch FROM clock_timestamp()) * 1000)::bigint, "
                        "(extract(epoch FROM pg_postmaster_start_time()) * 1000)::bigint") == 1));
  now_ms_ = std::strtoll(PQgetvalue(result.get(), 0, 0), nullptr, 10);
  server_start_ms_ = std::strtoll(PQgetvalue(result.get(), 0, 1), nullptr, 10);
  return absl::OkStatus();
}

bool PgConnection::lost() const { return gave_up_ || PQstatus(connection_) != CONNECTION_OK; }

std::unique_ptr<SqlStatement> PgConnection::Prepare(const std::string& sql) {
  return std::make_unique<PgStatement>(this, sql);
}

absl::Status PgConnection::Execute(const std::string& sql) {
  return Await(PQsendQuery(connection_, sql.c_str()) == 1).status();
}

absl::Status PgConnection::LockOwner(const std::string& owner) {
  const auto lock = Prepare("SELECT pg_advisory_xact_lock(hashtextextended('litags ' || ?1, 0))");
  lock->Bind(owner);
  return lock->Step().status();
}

void PgConnection::Announce(ChangeTopic topic) {
  (topic == ChangeTopic::kQueue ? announce_queue_ : announce_jobs_) = true;
}

absl::Status PgConnection::Begin() {
  announce_jobs_ = announce_queue_ = false;
  LITAGS_ASSIGN_OR_RETURN(
      const Result result,
      Await(PQsendQuery(connection_,
                        "BEGIN; SELECT (extract(epoch FROM clock_timestamp()) * 1000)::bigint, "
                        "pg_current_xact_id()") == 1));
  now_ms_ = std::strtoll(PQgetvalue(result.get(), 0, 0), nullptr, 10);
  transaction_id_ = PQgetvalue(result.get(), 0, 1);
  return absl::OkStatus();
}

absl::Status PgConnection::Commit() {
  std::string sql = "COMMIT";
  if (announce_jobs_) absl::StrAppend(&sql, "; NOTIFY ", ChannelOf(ChangeTopic::kJobs));
  if (announce_queue_) absl::StrAppend(&sql, "; NOTIFY ", ChannelOf(ChangeTopic::kQueue));
  Result first;
  const absl::Status status = Await(PQsendQuery(connection_, sql.c_str()) == 1, &first).status();
  if (!first || IsError(first.get())) return status;
  // A transaction of which a statement failed is rolled back by COMMIT.
  if (std::string_view(PQcmdStatus(first.get())) == "COMMIT") return absl::OkStatus();
  return MakeError(absl::StatusCode::kInternal, "STORE_FAILED", "",
                   "the job store rolled a transaction back of which a statement had failed");
}

absl::Status PgConnection::Rollback() { return Execute("ROLLBACK"); }

absl::StatusOr<PgConnection::Result> PgConnection::RunPrepared(
    const std::string& sql, const std::vector<Oid>& types, const std::vector<std::string>& values) {
  const int count = static_cast<int>(types.size());
  auto known = prepared_.find(sql);
  if (known == prepared_.end()) {
    std::string text = sql;
    std::replace(text.begin(), text.end(), '?', '$');
    const std::string name = absl::StrCat("s", prepared_.size());
    LITAGS_RETURN_IF_ERROR(
        Await(PQsendPrepare(connection_, name.c_str(), text.c_str(), count, types.data()) == 1)
            .status());
    known = prepared_.emplace(sql, name).first;
  }
  std::vector<const char*> pointers;
  for (const std::string& value : values) pointers.push_back(value.c_str());
  return Await(PQsendQueryPrepared(connection_, known->second.c_str(), count, pointers.data(),
                                   nullptr, nullptr, /*resultFormat=*/0) == 1);
}

absl::StatusOr<PgConnection::Result> PgConnection::Await(bool sent, Result* first) {
  can_retry_ = false;
  if (!sent) return Lost(Trimmed(PQerrorMessage(connection_)));
  const int64_t deadline_ms = MonotonicMs() + patience_ms_;
  Result last;
  absl::Status error;
  for (bool is_first = true;; is_first = false) {
    while (PQisBusy(connection_)) {
      if (!WaitForSocket(deadline_ms)) return Lost(Trimmed(PQerrorMessage(connection_)));
    }
    Result result(PQgetResult(connection_));
    if (!result) break;
    if (IsError(result.get())) error.Update(ErrorOf(result.get()));
    if (first && is_first) *first = Result(PQcopyResult(result.get(), 0));
    last = std::move(result);
  }
  if (!error.ok()) return error;
  return last;
}

bool PgConnection::WaitForSocket(int64_t deadline_ms) {
  const int unsent = PQflush(connection_);
  pollfd socket{PQsocket(connection_), static_cast<short>(POLLIN | (unsent > 0 ? POLLOUT : 0)), 0};
  const int64_t left_ms = deadline_ms - MonotonicMs();
  if (unsent < 0 || left_ms <= 0) return false;
  poll(&socket, 1, static_cast<int>(left_ms));
  return PQconsumeInput(connection_) == 1;
}

absl::StatusOr<bool> PgConnection::WaitForNotification(double seconds) {
  const int64_t deadline_ms = MonotonicMs() + static_cast<int64_t>(1000 * seconds);
  bool notified = false;
  for (;;) {
    if (PQconsumeInput(connection_) != 1) return Lost(Trimmed(PQerrorMessage(connection_)));
    while (PGnotify* notification = PQnotifies(connection_)) {
      PQfreemem(notification);
      notified = true;
    }
    if (notified || MonotonicMs() >= deadline_ms) return notified;
    if (!WaitForSocket(deadline_ms) && PQstatus(connection_) != CONNECTION_OK) {
      return Lost(Trimmed(PQerrorMessage(connection_)));
    }
  }
}

absl::Status PgConnection::Lost(const std::string& why) {
  gave_up_ = true;
  return StoreUnavailable(why.empty() ? "it does not answer" : why);
}

// Codes: PostgreSQL documentation, appendix A.
absl::Status PgConnection::ErrorOf(const PGresult* result) {
  const char* field = PQresultErrorField(result, PG_DIAG_SQLSTATE);
  const std::string_view code = field ? field : "";
  const std::string text = Trimmed(PQresultErrorMessage(result));
  if (code.empty() || code.starts_with("08") || code.starts_with("57P") || code == "25006" ||
      code == "25P03") {
    return Lost(text);  // also a server that only reads: a standby, or a primary that was demoted
  }
  can_retry_ = code == "40001" || code == "40P01";
  if (can_retry_ || code == "55P03" || code == "57014") return StoreBusy(text);
  if (code == "53100") {
    return MakeError(absl::StatusCode::kResourceExhausted, "DISK_FULL", "",
                     "the job store's disk is full; free some space and try again");
  }
  if (code.starts_with("53")) return StoreBusy(text);
  if (code.starts_with("XX00") && code != "XX000") {
    return MakeError(absl::StatusCode::kDataLoss, "STORE_CORRUPT", "",
                     absl::StrCat("the job store is damaged: ", text, "; put back a backup"));
  }
  if (code == "22021" || code == "22P05") {
    return InvalidInput("TEXT_INVALID", "", absl::StrCat("a text is not valid UTF-8: ", text));
  }
  if (code == "42501") {
    return MakeError(absl::StatusCode::kFailedPrecondition, "STORE_NOT_OPENED", "store",
                     absl::StrCat("the database's user lacks a right: ", text,
                                  "; make it the owner of a database of its own"));
  }
  return MakeError(absl::StatusCode::kInternal, "STORE_FAILED", "",
                   absl::StrCat("the job store failed: ", text));
}

}  // namespace litags
