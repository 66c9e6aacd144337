// What is PostgreSQL's own: a database that goes away, connections that break, commits whose answer
// is lost. Linked with the conformance cases.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <thread>
#include <utility>

#include "engine/core/error_test_util.h"
#include "engine/core/temp_dir_test_util.h"
#include "server/jobs/leases.h"
#include "server/store/postgres.h"
#include "server/store/postgres_listener.h"
#include "server/store/postgres_migrations.h"
#include "server/testing/cutting_proxy.h"
#include "server/testing/eventually.h"
#include "server/testing/job_store_kind.h"
#include "server/testing/postgres_server.h"

namespace litags {
namespace {

using ::testing::HasSubstr;
using SteadyClock = std::chrono::steady_clock;

class PostgresJobStoreTest : public ::testing::Test {
 protected:
  void SetUp() override {
    server_ = SharedPostgres();
    if (!server_) GTEST_SKIP() << "PostgreSQL is not installed here";
    url_ = *server_->NewDatabase();
    store_ = Open(url_);
  }

  static std::unique_ptr<JobStore> Open(const std::string& url) {
    auto store = OpenPostgresJobStore(url);
    EXPECT_TRUE(store.ok()) << store.status();
    return store.ok() ? *std::move(store) : nullptr;
  }

  std::string DatabaseName() const {
    const size_t start = url_.find("///") + 3;
    return url_.substr(start, url_.find('?') - start);
  }

  // Ends the connections to this test's database, as an operator may.
  void BreakConnections() {
    EXPECT_TRUE(server_
                    ->Execute("SELECT pg_terminate_backend(pid) FROM pg_stat_activity WHERE "
                              "datname = '" +
                              DatabaseName() + "'")
                    .ok());
  }

  PostgresServer* server_ = nullptr;
  std::string url_;
  std::unique_ptr<JobStore> store_;
};

TEST_F(PostgresJobStoreTest, CallsFailAtOnceWhileTheDatabaseIsAwayAndWorkWhenItIsBack) {
  ASSERT_TRUE(store_->Create(MakeJob("a1"), Nothing).ok());
  server_->Crash();
  const auto start = SteadyClock::now();
  for (const absl::Status& status :
       {store_->Get("a1").status(), store_->Update("a1", Nothing).status(),
        store_->Create(MakeJob("a2"), Nothing).status(), store_->Events("a1", 0, 9).status(),
        store_->UpdateFirstQueued(FitsAny, Nothing).status(), store_->List(0, "", 9).status()}) {
    EXPECT_EQ(status.code(), absl::StatusCode::kUnavailable);
    EXPECT_EQ(Reason(status), "STORE_UNAVAILABLE");
  }
  EXPECT_LT(SteadyClock::now() - start, std::chrono::seconds(5));
  ASSERT_TRUE(server_->Run().ok());
  // A pool that has just found the database away does not look for a moment.
  EXPECT_TRUE(Eventually([&] { return store_->Get("a1").ok(); }))
      << "what was acknowledged is there";
  EXPECT_TRUE(store_->Update("a1", Nothing).ok());
}

TEST_F(PostgresJobStoreTest, MessageOfADatabaseThatIsFullNamesTheSettingToRaise) {
  std::vector<std::unique_ptr<PgConnection>> connections;
  absl::Status refused;
  for (int i = 0; i < 200 && refused.ok(); ++i) {
    auto opened = PgConnection::Open(url_);
    refused = opened.status();
    if (opened.ok()) connections.push_back(*std::move(opened));
  }
  EXPECT_EQ(Reason(refused), "STORE_UNAVAILABLE");
  EXPECT_THAT(std::string(refused.message()), HasSubstr("raise PostgreSQL's max_connections"));
}

TEST_F(PostgresJobStoreTest, RestartBetweenTwoCallsIsNotNoticed) {
  ASSERT_TRUE(store_->Create(MakeJob("a1"), Nothing).ok());
  server_->Stop();
  ASSERT_TRUE(server_->Run().ok());
  EXPECT_TRUE(store_->Get("a1").ok());
  BreakConnections();
  EXPECT_TRUE(store_->Update("a1", Nothing).ok());
}

TEST_F(PostgresJobStoreTest, ConnectionsAreKeptThoughTheyAreIdle) {
  ASSERT_TRUE(server_
                  ->Execute("DO $$ BEGIN IF current_setting('server_version_num')::int >= 140000 "
                            "THEN ALTER DATABASE " +
                            DatabaseName() + " SET idle_session_timeout = '1s'; END IF; END $$")
                  .ok());
  const auto connection = *PgConnection::Open(url_);
  const auto row =
      connection->Prepare("SELECT COALESCE(current_setting('idle_session_timeout', true), '0')");
  ASSERT_TRUE(row->Step().value_or(false));
  EXPECT_EQ(row->Text(0), "0");
}

TEST_F(PostgresJobStoreTest, ConnectionThatIsClosedIsNoOutage) {
  ASSERT_TRUE(store_->Create(MakeJob("a1"), Nothing).ok());
  // A test that stands still for seconds in between sees an outage.
  EXPECT_TRUE(Eventually([&] {
    const int64_t since = store_->ReachableSinceMs();
    EXPECT_TRUE(store_->Get("a1").ok());
    BreakConnections();
    EXPECT_TRUE(server_
                    ->Execute("DO $$ BEGIN WHILE EXISTS (SELECT 1 FROM pg_stat_activity WHERE "
                              "datname = '" +
                              DatabaseName() +
                              "') LOOP PERFORM pg_sleep(0.01), pg_stat_clear_snapshot(); "
                              "END LOOP; END $$")
                    .ok());
    EXPECT_TRUE(store_->Update("a1", Nothing).ok());
    return store_->ReachableSinceMs() == since;
  }));
}

TEST_F(PostgresJobStoreTest, DatabaseThatOnlyReadsIsNotWritable) {
  ASSERT_TRUE(store_->CheckWritable().ok());
  const auto admin = *PgConnection::Open(url_);
  const auto execute = [&](const char* sql) { EXPECT_TRUE(admin->Execute(sql).ok()) << sql; };
  execute("SET default_transaction_read_only = off");
  execute("ALTER SYSTEM SET default_transaction_read_only = on");
  execute("SELECT pg_reload_conf()");
  absl::Status status;
  EXPECT_TRUE(Eventually([&] { return !(status = store_->CheckWritable()).ok(); }));
  EXPECT_EQ(Reason(status), "STORE_UNAVAILABLE");
  execute("ALTER SYSTEM RESET default_transaction_read_only");
  execute("SELECT pg_reload_conf()");
  EXPECT_TRUE(Eventually([&] { return store_->CheckWritable().ok(); }));
}

TEST_F(PostgresJobStoreTest, ConnectionThatBreaksInATransactionCostsNothingAndDoublesNothing) {
  ASSERT_TRUE(store_->Create(MakeJob("a1"), Nothing).ok());
  int calls = 0;
  const auto job = store_->Update("a1", [&](JobTransaction& transaction) -> absl::Status {
    LITAGS_RETURN_IF_ERROR(transaction.AddEvent({0, 1, EventKind::kState, "x"}));
    if (++calls == 1) BreakConnections();
    return absl::OkStatus();
  });
  EXPECT_TRUE(job.ok()) << job.status();
  EXPECT_EQ(calls, 2);
  EXPECT_EQ(store_->Events("a1", 0, 10)->size(), 1u);
}

TEST_F(PostgresJobStoreTest, CommitWhoseAnswerIsLostIsLookedUpAndNotRepeated) {
  CuttingProxy proxy(server_->port());
  auto store = Open(proxy.Through(server_->OverTcp(url_)));
  ASSERT_TRUE(store->Create(MakeJob("a1"), Nothing).ok());
  for (const auto cut : {CuttingProxy::kAfterRequest, CuttingProxy::kBeforeRequest}) {
    const int64_t events = store->Get("a1")->last_event;
    proxy.CutAt("COMMIT", cut);
    int calls = 0;
    const auto job = store->Update("a1", [&](JobTransaction& transaction) {
      ++calls;
      return transaction.AddEvent({0, 1, EventKind::kState, "x"});
    });
    EXPECT_TRUE(job.ok()) << job.status();
    EXPECT_TRUE(proxy.has_cut());
    // Committed, or rolled back and done again: once in either case.
    EXPECT_EQ(calls, cut == CuttingProxy::kAfterRequest ? 1 : 2);
    EXPECT_EQ(store->Get("a1")->last_event, events + 1);
    EXPECT_EQ(store->Events("a1", events, 10)->size(), 1u);
  }
}

TEST_F(PostgresJobStoreTest, DeadlockIsTriedAgain) {
  ASSERT_TRUE(store_->Create(MakeJob("a1"), Nothing).ok());
  const auto other = PgConnection::Open(url_);
  ASSERT_TRUE(other.ok());
  // PostgreSQL ends the transaction that notices the cycle; the other one does not look for it.
  ASSERT_TRUE((*other)->Execute("SET deadlock_timeout = '60s'").ok());
  std::thread waits_for_us;
  int calls = 0;
  const auto job = store_->Update("a1", [&](JobTransaction& transaction) -> absl::Status {
    if (++calls == 1) {
      LITAGS_RETURN_IF_ERROR((*other)->Begin());
      LITAGS_RETURN_IF_ERROR((*other)->LockOwner(""));
      waits_for_us = std::thread([&] {
        EXPECT_TRUE((*other)->Execute("UPDATE jobs SET photos = 1 WHERE id = 'a1'").ok());
        EXPECT_TRUE((*other)->Rollback().ok());
      });
      std::this_thread::sleep_for(std::chrono::milliseconds(300));
    }
    LITAGS_RETURN_IF_ERROR(transaction.Usage().status());  // waits for the other
    return transaction.AddEvent({0, 1, EventKind::kState, "x"});
  });
  waits_for_us.join();
  EXPECT_TRUE(job.ok()) << job.status();
  // The second try may have the row before the other one, and they wait for each other again.
  EXPECT_GE(calls, 2);
  EXPECT_EQ(store_->Events("a1", 0, 10)->size(), 1u);
}

TEST_F(PostgresJobStoreTest, WaiterIsToldOfAChange) {
  ASSERT_TRUE(store_->Create(MakeJob("a1"), Nothing).ok());
  // So seldom does it look by itself that it must be told.
  PgListener listener(url_, ChangeTopic::kJobs, /*look_every_seconds=*/60);
  int64_t token = listener.Wait(0, 20);  // it listens
  // A lease that is renewed, say: nobody can watch that.
  ASSERT_TRUE(store_->Update("a1", Nothing).ok());
  EXPECT_EQ(listener.Wait(token, 0.5), token);
  const auto is_told_of = [&](JobStore::Change change) {
    EXPECT_TRUE(store_->Update("a1", change).ok());
    return std::exchange(token, listener.Wait(token, 20)) != token;
  };
  const EventRecord event{0, 1, EventKind::kState, "x"};
  const LogEntry entry{0, 1, LogSeverity::kInfo, "x"};
  EXPECT_TRUE(is_told_of([&](JobTransaction& job) { return job.AddEvent(event); }));
  EXPECT_TRUE(is_told_of([&](JobTransaction& job) { return job.AddLog(entry); }));
  EXPECT_TRUE(is_told_of([](JobTransaction& job) { return job.Remove(); }));
}

TEST_F(PostgresJobStoreTest, WaiterStillLearnsOfChangesAfterItsConnectionBroke) {
  ASSERT_TRUE(store_->Create(MakeJob("a1"), Nothing).ok());
  int64_t token = *store_->WaitForChange(ChangeTopic::kJobs, -1, 0);
  BreakConnections();
  // Until only the change made here can end the wait.
  while (true) {
    const int64_t next = *store_->WaitForChange(ChangeTopic::kJobs, token, 1.5);
    if (next == token) break;
    token = next;
  }
  ASSERT_TRUE(store_->Update("a1", Nothing).ok());
  EXPECT_NE(*store_->WaitForChange(ChangeTopic::kJobs, token, 20), token);
}

TEST_F(PostgresJobStoreTest, WorkersKeepTheirJobsOverAnOutageLongerThanTheirLeases) {
  constexpr int64_t kLeaseMs = 1500;
  TempDir dir;
  auto blobs = *OpenDiskBlobStore(dir.path());
  Leases mine(store_.get(), blobs.get(), {kLeaseMs, 3});
  auto other_store = Open(url_);
  Leases others(other_store.get(), blobs.get(), {kLeaseMs, 3});
  ASSERT_TRUE(store_->Create(MakeJob("a1", 1, JobState::kQueued), Nothing).ok());
  const auto lease = mine.Acquire("w1");
  ASSERT_TRUE(lease.ok() && lease->has_value());
  server_->Crash();
  std::this_thread::sleep_for(std::chrono::milliseconds(kLeaseMs + 200));
  EXPECT_EQ(Reason(mine.Heartbeat(**lease, 0).status()), "STORE_UNAVAILABLE");
  ASSERT_TRUE(server_->Run().ok());
  // An idle worker that is the first to be back takes nothing.
  EXPECT_FALSE(others.Acquire("w2")->has_value());
  // A pool that has just found the database away does not look for a moment.
  absl::Status beat;
  EXPECT_TRUE(Eventually([&] {
    beat = mine.Heartbeat(**lease, 0).status();
    return Reason(beat) != "STORE_UNAVAILABLE";
  }));
  EXPECT_TRUE(beat.ok()) << beat;
  const absl::Status kept = mine.Keep(**lease, {{kSceneFile, {"1/aa", 5}}}, 5);
  EXPECT_TRUE(kept.ok()) << kept;
  // A worker that does not come back loses its job a lease later.
  EXPECT_TRUE(Eventually([&] { return others.Acquire("w2")->has_value(); }));
  EXPECT_EQ(Reason(mine.Heartbeat(**lease, 0).status()), "LEASE_LOST");
}

TEST_F(PostgresJobStoreTest, TakingAJobReadsAsMuchAsThereAreOwnersNotJobs) {
  constexpr int kOwners = 20, kJobs = 40000, kTakes = 10;
  const auto database = PgConnection::Open(url_);
  ASSERT_TRUE(database.ok()) << database.status();
  ASSERT_TRUE(store_->Create(MakeJob("model"), Nothing).ok());
  const absl::Status filled = (*database)->Execute(absl::StrCat(
      "CREATE TEMP TABLE made AS SELECT jobs.*, i FROM jobs, generate_series(1, ", kJobs,
      ") AS i; ", "UPDATE made SET id='job' || i, owner='owner' || i % ", kOwners, ", state=2; ",
      "ALTER TABLE made DROP COLUMN i; INSERT INTO jobs SELECT * FROM made; ANALYZE jobs"));
  ASSERT_TRUE(filled.ok()) << filled;
  const auto rows_read = [&]() -> int64_t {
    const auto row = (*database)->Prepare(
        "SELECT (SELECT SUM(idx_tup_read) FROM pg_stat_user_indexes WHERE relname='jobs') + "
        "(SELECT SUM(seq_tup_read) FROM pg_stat_user_tables WHERE relname='jobs')");
    return row->Step().value_or(false) ? row->Int(0) : -1;
  };
  // A connection tells what it read once a second at most, and only after it did something.
  const auto settled = [&] {
    std::this_thread::sleep_for(std::chrono::milliseconds(1100));
    EXPECT_TRUE(store_->Get("model").ok());
    EXPECT_TRUE((*database)->Execute("SELECT 1").ok());
    return rows_read();
  };
  const int64_t before = settled();
  for (int i = 0; i < kTakes; ++i) {
    const auto taken = store_->UpdateFirstQueued(FitsAny, [](JobTransaction& job) {
      job.job.state = JobState::kRunning;
      return absl::OkStatus();
    });
    ASSERT_TRUE(taken.ok() && *taken) << taken.status();
  }
  const int64_t read = settled() - before;
  EXPECT_GE(read, kTakes);  // it is counted at all
  // Some look-ups of each owner's first job; the queue has 2,000 rows of each.
  EXPECT_LT(read, kTakes * kOwners * 20);
}

TEST_F(PostgresJobStoreTest, CommitsAreOnDiskWhateverTheDatabasesDefaultIs) {
  const auto setting = [&](const std::string& by_default) {
    EXPECT_TRUE((*PgConnection::Open(url_))
                    ->Execute("ALTER DATABASE " + DatabaseName() +
                              " SET synchronous_commit = " + by_default)
                    .ok());
    const auto connection = *PgConnection::Open(url_);
    const auto row = connection->Prepare("SELECT current_setting('synchronous_commit')");
    return row->Step().value_or(false) ? row->Text(0) : "none";
  };
  EXPECT_EQ(setting("off"), "on");
  EXPECT_EQ(setting("remote_apply"), "remote_apply");
}

// A change of the layout may rewrite a large table, and other servers wait for it.
TEST_F(PostgresJobStoreTest, MigrationTakesTheTimeItNeeds) {
  const std::string url = *server_->NewDatabase();
  const auto mine = *PgConnection::Open(url), other = *PgConnection::Open(url);
  ASSERT_TRUE(mine->Execute("SET statement_timeout = 100; SET lock_timeout = 100").ok());
  ASSERT_TRUE(other->Execute("SELECT pg_advisory_lock(548247)").ok());
  std::thread migrates([&] {
    std::this_thread::sleep_for(std::chrono::milliseconds(500));
    EXPECT_TRUE(other->Execute("SELECT pg_advisory_unlock(548247)").ok());
  });
  const absl::Status status = MigratePostgres(mine.get());
  migrates.join();
  EXPECT_TRUE(status.ok()) << status;
  const auto row = mine->Prepare("SELECT current_setting('statement_timeout')");
  ASSERT_TRUE(row->Step().value_or(false));
  EXPECT_EQ(row->Text(0), "10s");
}

TEST_F(PostgresJobStoreTest, TextThatPostgresCannotKeepIsRefusedByName) {
  JobRecord job = MakeJob("a1");
  job.display_name = std::string("a\0b", 3);
  EXPECT_EQ(Reason(store_->Create(job, Nothing).status()), "TEXT_INVALID");
  job.display_name = "\xff";
  EXPECT_EQ(Reason(store_->Create(job, Nothing).status()), "TEXT_INVALID");
  job.display_name = "ok";
  EXPECT_TRUE(store_->Create(job, Nothing).ok());
}

TEST_F(PostgresJobStoreTest, ServerThatIsNotThereIsAClearError) {
  const auto store = OpenPostgresJobStore("postgresql://127.0.0.1:1/litags?user=nobody");
  EXPECT_EQ(Reason(store.status()), "STORE_UNAVAILABLE");
  EXPECT_THAT(std::string(store.status().message()), HasSubstr("127.0.0.1"));
}

}  // namespace
}  // namespace litags
