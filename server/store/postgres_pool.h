// Connections to one PostgreSQL database, and what is known of it. Internal to server/store.
#ifndef LITAGS_SERVER_STORE_POSTGRES_POOL_H_
#define LITAGS_SERVER_STORE_POSTGRES_POOL_H_

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/store/postgres.h"

namespace litags {

// Opens connections as they are needed, kMaxConnections at most, and keeps them. Thread-safe.
class PgPool {
 public:
  static constexpr int kMaxConnections = 8;

  explicit PgPool(std::string url) : url_(std::move(url)) {}

  struct PutBack {
    PgPool* pool;
    void operator()(PgConnection* connection) const { pool->Put(connection); }
  };
  using Handle = std::unique_ptr<PgConnection, PutBack>;

  // A connection for the caller alone, for as long as it keeps the handle. UNAVAILABLE
  // (STORE_UNAVAILABLE, STORE_BUSY), and the errors of PgConnection::Open().
  absl::StatusOr<Handle> Take();

  // Sets NowMs() by what the connection has just read of the database's clock.
  void SetClock(const PgConnection& connection);
  // The database's clock. Half a network round trip wrong at most, and the drift since SetClock().
  int64_t NowMs() const { return MonotonicMs() + clock_offset_ms_.load(); }

  // When the database was started, or, if that was later, when it was reached again after it could
  // not be for some seconds; by its clock. One connection that is closed is no outage.
  int64_t ReachableSinceMs() const { return reachable_since_ms_.load(); }

 private:
  void Put(PgConnection* connection);

  const std::string url_;
  std::atomic<int64_t> clock_offset_ms_{0}, reachable_since_ms_{0};

  std::mutex mutex_;
  std::condition_variable returned_;
  std::vector<std::unique_ptr<PgConnection>> idle_;
  int taken_ = 0;
  bool away_ = false;        // a connection was lost or refused, and none was opened since
  int64_t reached_ms_ = 0;   // when a connection was last good, by MonotonicMs()
  int64_t retry_at_ms_ = 0;  // calls fail with refusal_ until then
  absl::Status refusal_;
};

}  // namespace litags

#endif  // LITAGS_SERVER_STORE_POSTGRES_POOL_H_
