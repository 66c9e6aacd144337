#include "server/store/postgres_pool.h"

#include <algorithm>
#include <chrono>

namespace litags {
namespace {

constexpr std::chrono::seconds kLongestWait{5};
// While the database is away, connections are tried this often, however many calls fail.
constexpr int64_t kRetryAfterMs = 200;
// Without it for as long, some may not have renewed their leases.
constexpr int64_t kOutageMs = 3000;

}  // namespace

absl::StatusOr<PgPool::Handle> PgPool::Take() {
  std::unique_lock lock(mutex_);
  if (!returned_.wait_for(lock, kLongestWait, [this] { return taken_ < kMaxConnections; })) {
    return StoreBusy("all connections are in use");
  }
  if (!idle_.empty()) {
    ++taken_;
    PgConnection* const connection = idle_.back().release();
    idle_.pop_back();
    return Handle(connection, PutBack{this});
  }
  if (MonotonicMs() < retry_at_ms_) return refusal_;
  ++taken_;
  lock.unlock();
  absl::StatusOr<std::unique_ptr<PgConnection>> opened = PgConnection::Open(url_);
  lock.lock();
  if (!opened.ok()) {
    --taken_;
    returned_.notify_one();
    away_ = true;
    refusal_ = opened.status();
    retry_at_ms_ = MonotonicMs() + kRetryAfterMs;
    return refusal_;
  }
  SetClock(**opened);
  const int64_t reached_ms = MonotonicMs();
  const bool was_away = away_ && reached_ms - reached_ms_ > kOutageMs;
  const int64_t since = was_away ? (*opened)->now_ms() : (*opened)->server_start_ms();
  reachable_since_ms_ = std::max(reachable_since_ms_.load(), since);
  away_ = false;
  reached_ms_ = reached_ms;
  return Handle(opened->release(), PutBack{this});
}

void PgPool::Put(PgConnection* connection) {
  std::unique_ptr<PgConnection> owned(connection);
  std::lock_guard lock(mutex_);
  --taken_;
  if (connection->lost()) {
    idle_.clear();  // most likely lost with it
    away_ = true;
  } else {
    reached_ms_ = MonotonicMs();
    idle_.push_back(std::move(owned));
  }
  returned_.notify_one();
}

void PgPool::SetClock(const PgConnection& connection) {
  clock_offset_ms_ = connection.now_ms() - MonotonicMs();
}

}  // namespace litags
