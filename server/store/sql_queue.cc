#include "server/store/sql_queue.h"

#include <algorithm>
#include <limits>
#include <map>
#include <tuple>
#include <vector>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"

namespace litags {
namespace {

constexpr int64_t kForgetWorkerMs = int64_t{24} * 3600 * 1000;
constexpr int64_t kSetBackMs = 60'000;  // a time so far ahead is of before the clock was set back

// The queued jobs of one priority, needs and owner: where the first of them stands.
struct Line {
  std::string needs, owner;
  int64_t running = 0;  // jobs of the owner
  int64_t queue_time_ms = 0, create_time_ms = 0;
  std::string id;
};

// From line to line by the index jobs_by_queue: the next owner of the same needs, else the first
// one of the next needs. As written, both databases take each step by one look-up: SQLite would
// scan the queue for (needs, owner) > (..., ...), and PostgreSQL for a join with the step before.
constexpr char kLines[] =
    "WITH RECURSIVE first(id) AS ("
    "SELECT (SELECT id FROM jobs WHERE state=2 AND priority=?1 "
    "ORDER BY needs, owner, queue_time_ms, create_time_ms, id LIMIT 1) "
    "UNION ALL "
    "SELECT COALESCE("
    "(SELECT id FROM jobs WHERE state=2 AND priority=?1 "
    "AND needs=(SELECT needs FROM jobs WHERE id=first.id) "
    "AND owner>(SELECT owner FROM jobs WHERE id=first.id) "
    "ORDER BY owner, queue_time_ms, create_time_ms, id LIMIT 1), "
    "(SELECT id FROM jobs WHERE state=2 AND priority=?1 "
    "AND needs>(SELECT needs FROM jobs WHERE id=first.id) "
    "ORDER BY needs, owner, queue_time_ms, create_time_ms, id LIMIT 1)) "
    "FROM first WHERE first.id IS NOT NULL) "
    "SELECT needs, owner, queue_time_ms, create_time_ms, jobs.id, "
    "(SELECT COUNT(*) FROM jobs AS others WHERE others.state=3 AND others.owner=jobs.owner) "
    "FROM first, jobs WHERE jobs.id=first.id";

absl::StatusOr<std::vector<Line>> SelectLines(SqlSession& sql, int64_t priority,
                                              JobStore::Fits fits) {
  const auto row = sql.Prepare(kLines);
  row->Bind(priority);
  std::vector<Line> lines;
  std::map<std::string, bool> fit;
  for (;;) {
    LITAGS_ASSIGN_OR_RETURN(const bool more, row->Step());
    if (!more) break;
    Line line{row->Text(0), row->Text(1), row->Int(5), row->Int(2), row->Int(3), row->Text(4)};
    const auto [known, asked] = fit.try_emplace(line.needs);
    if (asked) known->second = fits(line.needs);
    if (known->second) lines.push_back(std::move(line));
  }
  std::sort(lines.begin(), lines.end(), [](const Line& a, const Line& b) {
    return std::tie(a.running, a.queue_time_ms, a.create_time_ms, a.id) <
           std::tie(b.running, b.queue_time_ms, b.create_time_ms, b.id);
  });
  return lines;
}

// The highest priority below `limit` that is in the queue.
absl::StatusOr<std::optional<int64_t>> PriorityBelow(SqlSession& sql, int64_t limit) {
  const auto row = sql.Prepare(
      "SELECT priority FROM jobs WHERE state=2 AND priority < ?1 ORDER BY priority DESC LIMIT 1");
  row->Bind(limit);
  LITAGS_ASSIGN_OR_RETURN(const bool found, row->Step());
  if (!found) return std::nullopt;
  return row->Int(0);
}

}  // namespace

absl::StatusOr<std::optional<std::string>> SelectQueued(SqlSession& sql, JobStore::Fits fits,
                                                        std::string_view lock) {
  const std::string first_of_line = absl::StrCat(
      "SELECT id FROM jobs WHERE state=2 AND priority=?1 AND needs=?2 AND owner=?3 "
      "ORDER BY queue_time_ms, create_time_ms, id LIMIT 1",
      std::string(lock));
  for (int64_t priority = std::numeric_limits<int64_t>::max();;) {
    LITAGS_ASSIGN_OR_RETURN(const auto next, PriorityBelow(sql, priority));
    if (!next) return std::nullopt;
    priority = *next;
    LITAGS_ASSIGN_OR_RETURN(const std::vector<Line> lines, SelectLines(sql, priority, fits));
    for (const Line& line : lines) {
      const auto row = sql.Prepare(first_of_line);
      row->Bind(priority).Bind(line.needs).Bind(line.owner);
      LITAGS_ASSIGN_OR_RETURN(const bool found, row->Step());
      if (found) return row->Text(0);
    }
  }
}

absl::Status UpsertWorker(SqlSession& sql, const WorkerRecord& worker) {
  const auto upsert = sql.Prepare(
      "INSERT INTO workers (name, seen_ms, resources) VALUES (?1,?2,?3) "
      "ON CONFLICT (name) DO UPDATE SET seen_ms=excluded.seen_ms, resources=excluded.resources");
  upsert->Bind(worker.name).Bind(worker.seen_ms).Bind(worker.resources);
  LITAGS_RETURN_IF_ERROR(upsert->Run().status());
  const auto forget = sql.Prepare("DELETE FROM workers WHERE seen_ms < ?1 OR seen_ms > ?2");
  forget->Bind(worker.seen_ms - kForgetWorkerMs).Bind(worker.seen_ms + kSetBackMs);
  return forget->Run().status();
}

absl::Status DeleteWorker(SqlSession& sql, std::string_view name) {
  const auto remove = sql.Prepare("DELETE FROM workers WHERE name=?1");
  remove->Bind(name);
  return remove->Run().status();
}

absl::StatusOr<std::vector<WorkerRecord>> SelectWorkers(SqlSession& sql, int64_t since_ms) {
  const auto row =
      sql.Prepare("SELECT name, seen_ms, resources FROM workers WHERE seen_ms >= ?1 ORDER BY name");
  row->Bind(since_ms);
  std::vector<WorkerRecord> workers;
  for (;;) {
    LITAGS_ASSIGN_OR_RETURN(const bool more, row->Step());
    if (!more) return workers;
    workers.push_back({row->Text(0), row->Int(1), row->Text(2)});
  }
}

}  // namespace litags
