// What the stores ask of an SQL database, whichever it is. Internal to server/store.
#ifndef LITAGS_SERVER_STORE_SQL_H_
#define LITAGS_SERVER_STORE_SQL_H_

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "server/store/job_store.h"

namespace litags {

// UNAVAILABLE (STORE_BUSY).
inline absl::Status StoreBusy(const std::string& why) {
  return MakeError(absl::StatusCode::kUnavailable, "STORE_BUSY", "",
                   absl::StrCat("the job store's database is busy: ", why,
                                "; nothing was changed, try again in a moment"));
}

// One statement in use: bound in order, then stepped. An error of Bind() is returned by Step().
class SqlStatement {
 public:
  virtual ~SqlStatement() = default;

  // Binds the next parameter.
  virtual SqlStatement& Bind(int64_t value) = 0;
  virtual SqlStatement& Bind(std::string_view value) = 0;

  // True: a row can be read.
  virtual absl::StatusOr<bool> Step() = 0;
  // For statements that return no rows: how many rows they changed.
  virtual absl::StatusOr<int64_t> Run() = 0;

  // Of the row; NULL reads as 0 and "".
  virtual int64_t Int(int column) const = 0;
  virtual std::string Text(int column) const = 0;
};

// Collects what `read` makes of each row.
template <typename Read>
auto ReadAll(SqlStatement& row, Read read) -> absl::StatusOr<std::vector<decltype(read(row))>> {
  std::vector<decltype(read(row))> all;
  for (;;) {
    LITAGS_ASSIGN_OR_RETURN(const bool more, row.Step());
    if (!more) return all;
    all.push_back(read(row));
  }
}

// A connection, or the transaction that is open on it. Not thread-safe.
class SqlSession {
 public:
  virtual ~SqlSession() = default;

  // Parameters are ?1, ?2, ... `sql` is kept prepared under its text, so it must not hold values.
  // The statement must not outlive the session.
  virtual std::unique_ptr<SqlStatement> Prepare(const std::string& sql) = 0;
  // Runs statements without parameters.
  virtual absl::Status Execute(const std::string& sql) = 0;

  // Keeps other transactions from asking what the owner's jobs amount to until this one has ended.
  // For databases whose transactions run side by side.
  virtual absl::Status LockOwner(const std::string& /*owner*/) { return absl::OkStatus(); }

  // Lets the open transaction, which is to free room, use what is kept for a full disk.
  // For databases on a disk of this machine.
  virtual void UseReserve() {}

  // Tells whoever waits for the topic, once the open transaction is committed.
  virtual void Announce(ChangeTopic) {}
};

}  // namespace litags

#endif  // LITAGS_SERVER_STORE_SQL_H_
