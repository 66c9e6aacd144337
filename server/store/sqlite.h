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

namespace litags {

// One statement in use: bound in order, stepped, and handed back to the connection's cache when
// this object ends. An error of any call is kept and returned by Step() or Run().
class Statement {
 public:
  Statement(sqlite3* db, sqlite3_stmt* stmt) : db_(db), stmt_(stmt) {}
  Statement(const Statement&) = delete;
  Statement& operator=(const Statement&) = delete;
  ~Statement();

  // Binds the next parameters.
  Statement& Bind(int64_t value);
  Statement& Bind(std::string_view value);

  // True: a row can be read.
  absl::StatusOr<bool> Step();
  // For statements that return no rows.
  absl::Status Run();

  int64_t Int(int column) const { return sqlite3_column_int64(stmt_, column); }
  std::string Text(int column) const;

 private:
  sqlite3* db_;
  sqlite3_stmt* stmt_;
  int next_parameter_ = 1;
  int bind_result_ = SQLITE_OK;
};

// One connection. Not thread-safe.
class SqliteConnection {
 public:
  static absl::StatusOr<std::unique_ptr<SqliteConnection>> Open(const std::string& path);
  ~SqliteConnection();

  // `sql` must be a literal or otherwise stay the same text: prepared statements are cached by it.
  Statement Prepare(const std::string& sql);
  // Runs statements without parameters.
  absl::Status Execute(const std::string& sql);

 private:
  explicit SqliteConnection(sqlite3* db) : db_(db) {}
  sqlite3* db_;
  std::unordered_map<std::string, sqlite3_stmt*> statements_;
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
