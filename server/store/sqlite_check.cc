#include <sys/stat.h>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "engine/core/error.h"
#include "server/store/file_error.h"
#include "server/store/job_store.h"
#include "server/store/sqlite.h"
#include "server/store/sqlite_migrations.h"
#include "server/store/sqlite_reserve.h"

namespace litags {

absl::Status CheckSqliteJobStore(const std::string& path) {
  struct stat info;
  if (stat(path.c_str(), &info) != 0) return absl::OkStatus();  // to be made
  const auto damaged = [&path](absl::string_view how) {
    return MakeError(absl::StatusCode::kDataLoss, "STORE_CORRUPT", "data",
                     absl::StrCat("the job store ", path, " is damaged (", how,
                                  "); put back a backup, or move litags.db* away to start with an "
                                  "empty store: docs/reliability.md"));
  };
  const auto unreadable = [&](const absl::Status& status) {
    if (absl::IsDataLoss(status)) return damaged(status.message());
    if (!HasReason(status, "DISK_FULL")) return status;
    return MakeError(
        absl::StatusCode::kResourceExhausted, "DISK_FULL", "data",
        absl::StrCat("the job store ", path, " cannot be opened, since its disk is full; free ",
                     kReserveBytes >> 20, " MiB there, then jobs can be deleted"));
  };
  DrawOnReserveToOpen(path);
  auto connection = SqliteConnection::Open(path);
  if (!connection.ok()) return unreadable(connection.status());
  const auto row = (*connection)->Prepare("PRAGMA quick_check(1)");
  const auto found = row->Step();
  if (!found.ok()) return unreadable(found.status());
  const std::string verdict = absl::StrReplaceAll(row->Text(0), {{"\n", " "}});
  return verdict == "ok" ? CheckSqliteVersion(connection->get()) : damaged(verdict);
}

}  // namespace litags
