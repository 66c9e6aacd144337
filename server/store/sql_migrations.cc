#include "server/store/sql_migrations.h"

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"

namespace litags {

absl::Status CheckVersion(int64_t found, absl::Span<const MigrationStep> steps) {
  const int64_t oldest = steps.front().version, newest = steps.back().version;
  if (found > newest) {
    return MakeError(
        absl::StatusCode::kFailedPrecondition, "STORE_TOO_NEW", "store",
        absl::StrCat("the job store has version ", found, ", this program knows versions up to ",
                     newest, "; use the newer program"));
  }
  if (found > 0 && found < oldest) {
    return MakeError(
        absl::StatusCode::kFailedPrecondition, "STORE_TOO_OLD", "store",
        absl::StrCat("the job store has version ", found, ", this program knows versions from ",
                     oldest, " on; start with another data folder"));
  }
  return absl::OkStatus();
}

absl::StatusOr<bool> MigrateOneStep(SqlSession& sql, absl::Span<const MigrationStep> steps,
                                    const VersionAccess& version, int64_t last) {
  const int64_t oldest = steps.front().version, newest = steps.back().version;
  LITAGS_ASSIGN_OR_RETURN(const int64_t found, version.get(sql));
  LITAGS_RETURN_IF_ERROR(CheckVersion(found, steps));
  if (found == newest || found >= last) return false;
  const MigrationStep& next = steps[static_cast<size_t>(found == 0 ? 0 : found + 1 - oldest)];
  LITAGS_RETURN_IF_ERROR(sql.Execute(next.sql));
  LITAGS_RETURN_IF_ERROR(version.set(sql, next.version));
  return true;
}

}  // namespace litags
