#include "server/store/sql_migrations.h"

#include <algorithm>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"

namespace litags {

absl::StatusOr<bool> MigrateOneStep(SqlSession& sql, absl::Span<const char* const> steps,
                                    const VersionAccess& version, int64_t last) {
  const auto newest = static_cast<int64_t>(steps.size());
  LITAGS_ASSIGN_OR_RETURN(const int64_t found, version.get(sql));
  if (found > newest) {
    return MakeError(
        absl::StatusCode::kFailedPrecondition, "STORE_TOO_NEW", "store",
        absl::StrCat("the job store has version ", found, ", this program knows versions up to ",
                     newest, "; use the newer program"));
  }
  if (found >= std::min(newest, last)) return false;
  LITAGS_RETURN_IF_ERROR(sql.Execute(steps[static_cast<size_t>(found)]));
  LITAGS_RETURN_IF_ERROR(version.set(sql, found + 1));
  return true;
}

}  // namespace litags
