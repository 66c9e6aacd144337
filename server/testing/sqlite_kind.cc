#include "absl/strings/str_cat.h"
#include "engine/core/temp_dir_test_util.h"
#include "server/store/open_stores.h"
#include "server/store/sqlite_migrations.h"
#include "server/testing/job_store_kind.h"

namespace litags {
namespace {

class SqliteKind : public JobStoreKind {
 public:
  absl::StatusOr<std::unique_ptr<JobStore>> Open() override { return OpenSqliteJobStore(path_); }

  absl::Status MakeOldest() override {
    LITAGS_ASSIGN_OR_RETURN(const auto old, SqliteConnection::Open(path_));
    LITAGS_RETURN_IF_ERROR(MigrateSqlite(old.get(), /*last=*/1));
    return old->Execute(kInsertOldJob);
  }

  absl::Status SetVersion(int64_t version) override {
    LITAGS_ASSIGN_OR_RETURN(const auto connection, SqliteConnection::Open(path_));
    return connection->Execute(absl::StrCat("PRAGMA user_version=", version));
  }

  absl::Status Check() override { return CheckJobStore({"sqlite://" + path_, "", ""}, {}); }

 private:
  TempDir dir_;
  const std::string path_ = dir_.path() + "/jobs.db";
};

}  // namespace

std::unique_ptr<JobStoreKind> MakeTestedKind() { return std::make_unique<SqliteKind>(); }

}  // namespace litags
