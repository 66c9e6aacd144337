#include <algorithm>
#include <chrono>
#include <mutex>
#include <thread>

#include "engine/core/error.h"
#include "server/store/postgres_listener.h"
#include "server/store/postgres_migrations.h"
#include "server/store/postgres_pool.h"
#include "server/store/sql_job_store.h"

namespace litags {
namespace {

constexpr int kTries = 6;
// What became of a commit whose answer was lost is asked for this long.
constexpr int64_t kOutcomeTimeoutMs = 8000;

void PauseBefore(int attempt) {
  std::this_thread::sleep_for(std::chrono::milliseconds(5 << attempt));
}

// Several connections; a job's transactions are kept apart by the lock of its row.
class PostgresJobStore : public SqlJobStore {
 public:
  explicit PostgresJobStore(const std::string& url)
      : SqlJobStore(" FOR UPDATE", " FOR UPDATE SKIP LOCKED"), url_(url), pool_(url) {}

  absl::Status Migrate() {
    LITAGS_ASSIGN_OR_RETURN(const auto connection, pool_.Take());
    return MigratePostgres(connection.get());
  }

  absl::StatusOr<int64_t> WaitForChange(ChangeTopic topic, int64_t seen, double seconds) override {
    return ListenerOf(topic).Wait(seen, seconds);
  }
  absl::Status CheckWritable() override {
    // Refused by a session that only reads, whose connection is lost for it.
    return Read([](SqlSession& sql) { return sql.Execute("DELETE FROM workers WHERE false"); });
  }
  int64_t NowMs() override { return pool_.NowMs(); }
  int64_t ReachableSinceMs() override { return pool_.ReachableSinceMs(); }

 private:
  absl::Status Read(ReadWork work) override {
    for (int attempt = 1;; ++attempt) {
      LITAGS_ASSIGN_OR_RETURN(const auto connection, pool_.Take());
      const absl::Status status = work(*connection);
      if (status.ok() || !MayTryAgain(*connection, attempt)) return status;
    }
  }

  absl::Status Write(WriteWork work) override {
    for (int attempt = 1;; ++attempt) {
      LITAGS_ASSIGN_OR_RETURN(auto connection, pool_.Take());
      const absl::StatusOr<bool> commit = BeginAndRun(*connection, work);
      if (!commit.ok() || !*commit) {
        const bool again = !commit.ok() && MayTryAgain(*connection, attempt);
        if (!connection->lost()) connection->Rollback().IgnoreError();
        if (again) continue;
        return commit.status();
      }
      const absl::Status status = connection->Commit();
      if (status.ok()) return status;
      if (!connection->lost()) {
        if (MayTryAgain(*connection, attempt)) continue;
        return status;
      }
      const std::string transaction = connection->transaction_id();
      connection.reset();
      LITAGS_ASSIGN_OR_RETURN(const bool committed, OutcomeOf(transaction));
      if (committed) return absl::OkStatus();
      if (attempt >= kTries) return status;
    }
  }

  absl::StatusOr<bool> BeginAndRun(PgConnection& connection, WriteWork work) {
    LITAGS_RETURN_IF_ERROR(connection.Begin());
    pool_.SetClock(connection);
    return work(connection);
  }

  // Whether a failed transaction is worth another try: the database asks for it, or the connection
  // was an old one that had died unnoticed.
  static bool MayTryAgain(const PgConnection& connection, int attempt) {
    if (connection.lost()) return attempt == 1;
    if (!connection.can_retry() || attempt >= kTries) return false;
    PauseBefore(attempt);
    return true;
  }

  // Whether the transaction is committed whose connection broke before the answer came.
  absl::StatusOr<bool> OutcomeOf(const std::string& transaction) {
    const int64_t deadline_ms = MonotonicMs() + kOutcomeTimeoutMs;
    for (int attempt = 1;; ++attempt) {
      if (const auto connection = pool_.Take(); connection.ok()) {
        const auto row = (*connection)->Prepare("SELECT pg_xact_status(?1::text::xid8)");
        row->Bind(transaction);
        if (row->Step().ok()) {
          const std::string status = row->Text(0);
          if (status == "committed") return true;
          if (status == "aborted") return false;
        }
      }
      if (MonotonicMs() >= deadline_ms) break;
      PauseBefore(std::min(attempt, 5));
    }
    return MakeError(absl::StatusCode::kUnavailable, "STORE_OUTCOME_UNKNOWN", "",
                     "the job store's database went away while it committed; look whether the "
                     "change was made before you try again");
  }

  PgListener& ListenerOf(ChangeTopic topic) {
    std::lock_guard lock(mutex_);
    auto& listener = listeners_[static_cast<size_t>(topic)];
    if (!listener) listener = std::make_unique<PgListener>(url_, topic);
    return *listener;
  }

  const std::string url_;
  PgPool pool_;
  std::mutex mutex_;
  std::unique_ptr<PgListener> listeners_[2];  // made when first asked for
};

}  // namespace

absl::StatusOr<std::unique_ptr<JobStore>> OpenPostgresJobStore(const std::string& url) {
  auto store = std::make_unique<PostgresJobStore>(url);
  LITAGS_RETURN_IF_ERROR(store->Migrate());
  return std::unique_ptr<JobStore>(std::move(store));
}

}  // namespace litags
