#include "server/store/sqlite_migrations.h"
#include "server/testing/job_store_kind.h"
#include "server/testing/temp_dir.h"

namespace litags {
namespace {

class SqliteKind : public JobStoreKind {
 public:
  absl::StatusOr<std::unique_ptr<JobStore>> Open() override { return OpenSqliteJobStore(path_); }

  absl::Status MakeOld(int64_t version) override {
    LITAGS_ASSIGN_OR_RETURN(const auto old, SqliteConnection::Open(path_));
    LITAGS_RETURN_IF_ERROR(MigrateSqlite(old.get(), 1));
    LITAGS_RETURN_IF_ERROR(
        old->Execute("INSERT INTO jobs VALUES ('a1','req','old',2,0,0,'',0,1,0,0,1,0,0,0,-1,'',"
                     "'{}','','','')"));
    return MigrateSqlite(old.get(), version);
  }
  int64_t newest_version() const override { return 6; }

  absl::Status MakeTooNew() override {
    LITAGS_ASSIGN_OR_RETURN(const auto connection, SqliteConnection::Open(path_));
    return connection->Execute("PRAGMA user_version=99");
  }

 private:
  TempDir dir_;
  const std::string path_ = dir_.path() + "/jobs.db";
};

}  // namespace

std::unique_ptr<JobStoreKind> MakeTestedKind() { return std::make_unique<SqliteKind>(); }

}  // namespace litags
