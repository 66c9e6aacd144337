#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

#include "absl/strings/str_join.h"
#include "engine/core/error_test_util.h"
#include "engine/core/temp_dir_test_util.h"
#include "server/store/job_store.h"
#include "server/store/sql_files.h"
#include "server/store/sql_jobs.h"
#include "server/store/sqlite.h"
#include "server/store/sqlite_migrations.h"
#include "server/store/sqlite_reserve.h"
#include "server/testing/no_room.h"

namespace litags {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

// How SQLite goes about what is asked through it.
class PlanningSession : public SqlSession {
 public:
  explicit PlanningSession(SqlSession* sql) : sql_(sql) {}
  std::unique_ptr<SqlStatement> Prepare(const std::string& sql) override {
    const auto row = sql_->Prepare("EXPLAIN QUERY PLAN " + sql);
    const auto steps = ReadAll(*row, [](const SqlStatement& step) { return step.Text(3); });
    plans.push_back(absl::StrJoin(*steps, "; "));
    return sql_->Prepare(sql);
  }
  absl::Status Execute(const std::string& sql) override { return sql_->Execute(sql); }
  std::vector<std::string> plans;

 private:
  SqlSession* const sql_;
};

class SqliteJobStoreTest : public ::testing::Test {
 protected:
  TempDir dir_;
};

TEST_F(SqliteJobStoreTest, DamagedPageIsFoundBeforeItIsServed) {
  const std::string path = dir_.path() + "/jobs.db";
  {
    auto store = *OpenSqliteJobStore(path);
    for (int i = 0; i < 200; ++i) {
      JobRecord job;
      job.id = "job" + std::to_string(i);
      ASSERT_TRUE(store->Create(job, [](JobTransaction&) { return absl::OkStatus(); }).ok());
    }
  }
  EXPECT_TRUE(CheckSqliteJobStore(path).ok());
  EXPECT_TRUE(CheckSqliteJobStore(dir_.path() + "/none.db").ok());
  constexpr int kPage = 4096;
  const auto pages = static_cast<int>(std::filesystem::file_size(path)) / kPage;
  ASSERT_GT(pages, 4);
  for (const int page : {0, pages / 2}) {
    std::fstream file(path, std::ios::in | std::ios::out | std::ios::binary);
    file.seekp(page * kPage);
    file << std::string(kPage, '\x5a') << std::flush;
    const absl::Status status = CheckSqliteJobStore(path);
    EXPECT_EQ(Reason(status), "STORE_CORRUPT") << page;
    EXPECT_THAT(std::string(status.message()), ::testing::HasSubstr("backup"));
    EXPECT_FALSE(OpenSqliteJobStore(path).ok() && page == 0);
  }
}

TEST_F(SqliteJobStoreTest, WriterThatTakesTooLongMakesOthersTryAgainLater) {
  const auto first = *SqliteConnection::Open(dir_.path() + "/jobs.db");
  const auto second = *SqliteConnection::Open(dir_.path() + "/jobs.db", /*busy_timeout_ms=*/20);
  auto writing = SqliteTransaction::Begin(first.get());
  ASSERT_TRUE(writing.ok()) << writing.status();
  const absl::Status refused = SqliteTransaction::Begin(second.get()).status();
  EXPECT_EQ(refused.code(), absl::StatusCode::kUnavailable);
  EXPECT_EQ(Reason(refused), "STORE_BUSY");
  writing->reset();
  EXPECT_TRUE(SqliteTransaction::Begin(second.get()).ok());
}

TEST_F(SqliteJobStoreTest, IsReachableOnlySinceAWriteSucceededAgain) {
  auto store = *OpenSqliteJobStore(dir_.path() + "/jobs.db");
  int64_t seen_ms = 0;  // another one each time, or nothing is written
  const auto write = [&] { return store->PutWorker({"w", ++seen_ms, ""}); };
  ASSERT_TRUE(write().ok());
  EXPECT_EQ(store->ReachableSinceMs(), 0);
  {
    const NoRoom no_room;
    EXPECT_FALSE(write().ok());
    EXPECT_FALSE(write().ok());
  }
  const int64_t before_ms = store->NowMs();
  EXPECT_GE(store->ReachableSinceMs(), before_ms);
  ASSERT_TRUE(write().ok());
  const int64_t since_ms = store->ReachableSinceMs();
  EXPECT_GE(since_ms, before_ms);
  EXPECT_TRUE(absl::IsNotFound(store->Get("none").status()));
  ASSERT_TRUE(write().ok());
  EXPECT_EQ(store->ReachableSinceMs(), since_ms);
}

// Else another process that ends takes itself for the last one, and removes the log of all.
TEST_F(SqliteJobStoreTest, OpeningTheFileAgainKeepsTheLocksOfTheFirstConnection) {
  const std::string path = dir_.path() + "/jobs.db";
  const auto store = *OpenSqliteJobStore(path);
  ASSERT_TRUE(store->PutWorker({"w", 1, ""}).ok());
  const auto is_locked = [&] {
    const pid_t other = fork();
    if (other == 0) {
      struct flock lock = {};
      lock.l_type = F_WRLCK;
      lock.l_start = 0x40000002;  // SHARED_FIRST and SHARED_SIZE of SQLite's file format
      lock.l_len = 510;
      const int fd = open(path.c_str(), O_RDWR | O_CLOEXEC);
      _exit(fcntl(fd, F_GETLK, &lock) == 0 && lock.l_type != F_UNLCK ? 1 : 0);
    }
    int status = 0;
    waitpid(other, &status, 0);
    return WIFEXITED(status) && WEXITSTATUS(status) == 1;
  };
  EXPECT_TRUE(is_locked());
  ASSERT_TRUE(SqliteConnection::Open(path).ok());
  EXPECT_TRUE(is_locked());
}

// On a disk that is full: tests/crash/full_disk_test.py.
TEST_F(SqliteJobStoreTest, ReserveTakesRoomAndIsGivenBackInParts) {
  const std::string path = dir_.path() + "/jobs.db", reserve = path + "-reserve";
  const auto store = *OpenSqliteJobStore(path);
  struct stat info = {};
  ASSERT_EQ(stat(reserve.c_str(), &info), 0);
  EXPECT_EQ(info.st_size, kReserveBytes);
  EXPECT_GE(info.st_blocks * 512, kReserveBytes);
  int parts = 0;
  for (int64_t left = kReserveBytes; DrawOnReserve(path); ++parts) {
    const auto size = static_cast<int64_t>(std::filesystem::file_size(reserve));
    ASSERT_LT(size, left);
    left = size;
  }
  EXPECT_GT(parts, 4);
  EXPECT_EQ(std::filesystem::file_size(reserve), 0u);
  EXPECT_TRUE(FillReserve(path));
  EXPECT_EQ(std::filesystem::file_size(reserve), size_t{kReserveBytes});
}

TEST_F(SqliteJobStoreTest, CommitsAreSyncedInWalMode) {
  const auto connection = *SqliteConnection::Open(dir_.path() + "/jobs.db");
  const auto setting = [&](const std::string& name) {
    const auto row = connection->Prepare("PRAGMA " + name);
    return row->Step().value_or(false) ? row->Text(0) : "none";
  };
  EXPECT_EQ(setting("journal_mode"), "wal");
  EXPECT_EQ(setting("synchronous"), "2");  // FULL
}

TEST_F(SqliteJobStoreTest, APageOfAListBeginsInItsIndex) {
  const auto connection = *SqliteConnection::Open(dir_.path() + "/jobs.db");
  ASSERT_TRUE(MigrateSqlite(connection.get()).ok());
  PlanningSession sql(connection.get());
  for (const ListOrder order : {ListOrder::kNewestFirst, ListOrder::kOldestFirst}) {
    ASSERT_TRUE(SelectPage(sql, 1, "a", 10, std::nullopt, order).ok());
    ASSERT_TRUE(SelectPage(sql, 1, "a", 10, "alice", order).ok());
  }
  EXPECT_THAT(sql.plans, ::testing::SizeIs(4));
  EXPECT_THAT(sql.plans,
              ::testing::Each(AllOf(HasSubstr("SEARCH"), HasSubstr("(create_time_ms,id)"),
                                    Not(HasSubstr("SCAN")), Not(HasSubstr("TEMP B-TREE")))));
}

TEST_F(SqliteJobStoreTest, OneCopyOfAFileIsReadToFindIt) {
  const auto connection = *SqliteConnection::Open(dir_.path() + "/jobs.db");
  ASSERT_TRUE(MigrateSqlite(connection.get()).ok());
  PlanningSession sql(connection.get());
  ASSERT_FALSE((*SelectSameFile(sql, "a", FileRole::kPhoto, "d1")).has_value());
  ASSERT_THAT(sql.plans, ::testing::SizeIs(2));
  EXPECT_THAT(sql.plans[0], HasSubstr("(sha256=? AND job_id=? AND role=?)"));
  EXPECT_THAT(sql.plans[1],
              AllOf(HasSubstr("SEARCH"), HasSubstr("(sha256=?"), Not(HasSubstr("TEMP B-TREE"))));
}

TEST_F(SqliteJobStoreTest, FolderThatDoesNotExistIsAClearError) {
  const auto store = OpenSqliteJobStore(dir_.path() + "/missing/jobs.db");
  EXPECT_EQ(Reason(store.status()), "STORE_NOT_OPENED");
  EXPECT_THAT(std::string(store.status().message()), ::testing::HasSubstr("missing/jobs.db"));
}

}  // namespace
}  // namespace litags
