// The little of libpq that the store needs. Internal to server/store.
#ifndef LITAGS_SERVER_STORE_POSTGRES_H_
#define LITAGS_SERVER_STORE_POSTGRES_H_

#include <libpq-fe.h>

#include <cstdint>
#include <memory>
#include <string>
#include <unordered_map>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/store/sql.h"

namespace litags {

// Names that NOTIFY and LISTEN use.
const char* ChannelOf(ChangeTopic topic);

// Of a statement and of a lock, at the server.
inline constexpr int kStatementTimeoutMs = 10000, kLockTimeoutMs = 8000;

// One connection. No call takes longer than some seconds, also when the network swallows packets:
// a connection that does not answer counts as lost. Not thread-safe.
class PgConnection : public SqlSession {
 public:
  // `url`: a libpq URL or connection string. UNAVAILABLE (STORE_UNAVAILABLE), FAILED_PRECONDITION
  // (STORE_TOO_OLD).
  static absl::StatusOr<std::unique_ptr<PgConnection>> Open(const std::string& url);
  ~PgConnection() override;

  std::unique_ptr<SqlStatement> Prepare(const std::string& sql) override;
  absl::Status Execute(const std::string& sql) override;
  absl::Status LockOwner(const std::string& owner) override;
  void Announce(ChangeTopic topic) override;

  // Opens a transaction, and reads the clock and the transaction's number on the way.
  absl::Status Begin();
  // Announcements follow a commit, as a statement of their own: within a transaction, PostgreSQL
  // lets one announcing commit at a time go to disk. One that is lost with its connection costs
  // listeners the time until they look by themselves.
  absl::Status Commit();
  absl::Status Rollback();
  const std::string& transaction_id() const { return transaction_id_; }

  // How long a statement may take from now on; 0: any time, while the server is there.
  absl::Status SetStatementTimeout(int ms);

  // Nothing can be done with it any more.
  bool lost() const;
  // The last error rolled the transaction back through no fault of its own: serialization,
  // deadlock.
  bool can_retry() const { return can_retry_; }

  // Waits for a NOTIFY on the channels listened to. False: none came.
  absl::StatusOr<bool> WaitForNotification(double seconds);

  // By the database's clock, milliseconds since 1970: the time when it was asked last, which
  // Begin() and ReadClock() do, and when the server was started.
  absl::Status ReadClock();
  int64_t now_ms() const { return now_ms_; }
  int64_t server_start_ms() const { return server_start_ms_; }

 private:
  friend class PgStatement;
  struct Clear {
    void operator()(PGresult* result) const { PQclear(result); }
  };
  using Result = std::unique_ptr<PGresult, Clear>;

  explicit PgConnection(PGconn* connection);
  absl::Status SetUp();
  absl::StatusOr<Result> RunPrepared(const std::string& sql, const std::vector<Oid>& types,
                                     const std::vector<std::string>& values);
  // The result of the last statement sent, or the first error. `first`: that of the first one.
  absl::StatusOr<Result> Await(bool sent, Result* first = nullptr);
  // False: the time is over, or the connection is gone.
  bool WaitForSocket(int64_t deadline_ms);
  absl::Status ErrorOf(const PGresult* result);
  absl::Status Lost(const std::string& why);

  PGconn* const connection_;
  std::unordered_map<std::string, std::string> prepared_;  // name by text
  int64_t patience_ms_;                                    // of a call
  bool gave_up_ = false;
  bool can_retry_ = false;
  bool announce_jobs_ = false, announce_queue_ = false;
  std::string transaction_id_;
  int64_t now_ms_ = 0, server_start_ms_ = 0;
};

// Milliseconds of a clock that nobody sets and that goes on while the machine sleeps.
int64_t MonotonicMs();

// UNAVAILABLE (STORE_UNAVAILABLE).
absl::Status StoreUnavailable(const std::string& why);

}  // namespace litags

#endif  // LITAGS_SERVER_STORE_POSTGRES_H_
