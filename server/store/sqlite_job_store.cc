#include <atomic>
#include <chrono>
#include <mutex>
#include <thread>

#include "engine/core/error.h"
#include "server/store/file_error.h"
#include "server/store/sql_job_store.h"
#include "server/store/sqlite.h"
#include "server/store/sqlite_migrations.h"
#include "server/store/sqlite_reserve.h"

namespace litags {
namespace {

// A change of another process is seen after this at most.
constexpr std::chrono::milliseconds kPollInterval{50};

// One connection, one writer at a time: transactions need no row locks.
class SqliteJobStore : public SqlJobStore {
 public:
  SqliteJobStore(std::string path, std::unique_ptr<SqliteConnection> db)
      : SqlJobStore("", ""),
        path_(std::move(path)),
        db_(std::move(db)),
        reserve_is_full_(FillReserve(path_)) {}

  // Whoever waits for the queue is woken by all changes; looking at it is cheap here.
  absl::StatusOr<int64_t> WaitForChange(ChangeTopic, int64_t seen, double seconds) override {
    const auto end = std::chrono::steady_clock::now() + std::chrono::duration<double>(seconds);
    for (;;) {
      LITAGS_ASSIGN_OR_RETURN(const int64_t token, ChangeToken());
      const auto left = end - std::chrono::steady_clock::now();
      if (token != seen || left.count() <= 0) return token;
      std::this_thread::sleep_for(std::min<std::chrono::duration<double>>(kPollInterval, left));
    }
  }

  int64_t NowMs() override { return SystemClockMs(); }
  // Where this process cannot write, as on a full disk, others cannot renew their leases.
  int64_t ReachableSinceMs() override { return fails_ ? NowMs() : reachable_since_ms_.load(); }

 private:
  absl::Status Read(ReadWork work) override {
    std::lock_guard lock(mutex_);
    return work(*db_);
  }

  absl::Status Write(WriteWork work) override {
    std::lock_guard lock(mutex_);
    absl::Status status = WriteOnce(work);
    while (HasReason(status, "DISK_FULL") && db_->uses_reserve() && DrawOnReserve(path_)) {
      reserve_is_full_ = false;
      status = WriteOnce(work);
    }
    if (status.ok() && !reserve_is_full_) reserve_is_full_ = FillReserve(path_);
    if (HasReason(status, "DISK_FULL") || HasReason(status, "STORE_FAILED") ||
        HasReason(status, "STORE_BUSY")) {
      fails_ = true;
    }
    return status;
  }

  absl::Status WriteOnce(WriteWork work) {
    LITAGS_ASSIGN_OR_RETURN(const auto transaction, SqliteTransaction::Begin(db_.get()));
    LITAGS_ASSIGN_OR_RETURN(const bool commit, work(*db_));
    if (!commit) return absl::OkStatus();
    LITAGS_RETURN_IF_ERROR(transaction->Commit());
    ++own_commits_;
    if (fails_) reachable_since_ms_ = NowMs();
    fails_ = false;
    return absl::OkStatus();
  }

  absl::StatusOr<int64_t> ChangeToken() {
    std::lock_guard lock(mutex_);
    // data_version moves with other connections' commits only; ours are counted.
    const auto row = db_->Prepare("PRAGMA data_version");
    LITAGS_RETURN_IF_ERROR(row->Step().status());
    return own_commits_ + row->Int(0);
  }

  const std::string path_;
  std::mutex mutex_;
  std::unique_ptr<SqliteConnection> db_;
  bool reserve_is_full_;
  int64_t own_commits_ = 0;
  std::atomic<bool> fails_ = false;  // since a write that did
  std::atomic<int64_t> reachable_since_ms_ = 0;
};

}  // namespace

absl::StatusOr<std::unique_ptr<JobStore>> OpenSqliteJobStore(const std::string& path) {
  LITAGS_ASSIGN_OR_RETURN(auto connection, SqliteConnection::Open(path));
  LITAGS_RETURN_IF_ERROR(MigrateSqlite(connection.get()));
  return std::unique_ptr<JobStore>(std::make_unique<SqliteJobStore>(path, std::move(connection)));
}

}  // namespace litags
