// The little of SQLite that the store needs. Internal to server/store.
#ifndef LITAGS_SERVER_STORE_SQLITE_H_
#define LITAGS_SERVER_STORE_SQLITE_H_

#include <sqlite3.h>

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <unordered_map>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/store/sql.h"

namespace litags {

class SqliteStatement : public SqlStatement {
 public:
  SqliteStatement(sqlite3* db, sqlite3_stmt* stmt) : db_(db), stmt_(stmt) {}
  SqliteStatement(const SqliteStatement&) = delete;
  SqliteStatement& operator=(const SqliteStatement&) = delete;
  ~SqliteStatement() override;  // back to the connection's cache

  SqlStatement& Bind(int64_t value) override;
  SqlStatement& Bind(std::string_view value) override;
  absl::StatusOr<bool> Step() override;
  absl::StatusOr<int64_t> Run() override;
  int64_t Int(int column) const override { return sqlite3_column_int64(stmt_, column); }
  std::string Text(int column) const override;

 private:
  sqlite3* db_;
  sqlite3_stmt* stmt_;
  int next_parameter_ = 1;
  int bind_result_ = SQLITE_OK;
};

// One connection. Not thread-safe.
class SqliteConnection : public SqlSession {
 public:
  // Other connections' writes are waited for; UNAVAILABLE (STORE_BUSY) after so long.
  static absl::StatusOr<std::unique_ptr<SqliteConnection>> Open(const std::string& path,
                                                                int busy_timeout_ms = 10000);
  ~SqliteConnection() override;

  std::unique_ptr<SqlStatement> Prepare(const std::string& sql) override;
  absl::Status Execute(const std::string& sql) override;
  void UseReserve() override { uses_reserve_ = true; }

  // Whether the last transaction may; see SqlSession::UseReserve().
  bool uses_reserve() const { return uses_reserve_; }

 private:
  friend class SqliteTransaction;
  explicit SqliteConnection(sqlite3* db) : db_(db) {}
  sqlite3* db_;
  std::unordered_map<std::string, sqlite3_stmt*> statements_;
  bool uses_reserve_ = false;
};

// A write transaction: rolled back unless Commit() succeeded.
class SqliteTransaction {
 public:
  static absl::StatusOr<std::unique_ptr<SqliteTransaction>> Begin(SqliteConnection* connection);
  ~SqliteTransaction();
  absl::Status Commit();

 private:
  explicit SqliteTransaction(SqliteConnection* connection) : connection_(connection) {}
  SqliteConnection* connection_;
  bool done_ = false;
};

}  // namespace litags

#endif  // LITAGS_SERVER_STORE_SQLITE_H_
