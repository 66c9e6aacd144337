// Where jobs, their files and their events are kept. The interface says what a store must
// guarantee; which changes are allowed is decided above it (server/jobs).
#ifndef LITAGS_SERVER_STORE_JOB_STORE_H_
#define LITAGS_SERVER_STORE_JOB_STORE_H_

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "absl/functional/function_ref.h"
#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace litags {

// Milliseconds since 1970.
using Clock = std::function<int64_t()>;
int64_t SystemClockMs();
// Of a clock that nobody sets, and that stands still while the machine sleeps; since any moment.
int64_t AwakeClockMs();

// Stored as numbers: never change or reuse them.
enum class JobState {
  kUploading = 1,
  kQueued = 2,
  kRunning = 3,
  kSucceeded = 4,
  kFailed = 5,
  kCancelled = 6,
};

struct JobRecord {
  std::string id;
  std::string owner;       // name of the client that made it; empty: made without authentication
  std::string request_id;  // empty: none; unique per owner
  std::string request_digest;  // of the request with that id; empty: not known
  std::string display_name;
  std::string labels;  // the client's words: JSON, opaque to the store; empty: none
  // Of the call that queued it last, so that the same call is known again; empty: none.
  std::string start_request_id;
  std::string content_digest;  // what the creator said would be uploaded; empty: nothing said
  std::string clone_source;    // id of the job whose files it has yet to take; empty: none
  JobState state = JobState::kUploading;
  bool cancel_requested = false;
  int attempt = 0;    // leases since it was last queued by a user
  int priority = 0;   // higher ones leave the queue first
  std::string needs;  // what its worker must have; opaque to the store; empty: nothing

  // The lease of the worker that runs it; meaningful in kRunning only.
  std::string lease_owner;
  int64_t lease_start_ms = 0;
  int64_t lease_expires_ms = 0;
  int64_t run_ms = 0;  // of its engine since it was last queued by a user, as workers told

  // Times in milliseconds since 1970; 0: not yet.
  int64_t create_time_ms = 0;
  int64_t start_time_ms = 0;
  int64_t end_time_ms = 0;
  int64_t queue_time_ms = 0;
  int64_t expire_time_ms = 0;  // from then on it may be removed; 0: never
  int64_t webhook_due_ms = 0;  // from then on its end is to be told; 0: it is not

  int64_t last_event = 0;      // number of the newest event
  int64_t last_log_entry = 0;  // number of the newest entry of its log
  int64_t log_bytes = 0;       // of all its log's texts
  int64_t photos = 0;          // kept by the store
  int64_t bytes = 0;           // of all files; kept by the store

  int snapshot_iteration = -1;          // -1: no snapshot
  bool has_unreferenced_blobs = false;  // there may be blobs of it that nothing names
  int64_t unreferenced_bytes = 0;       // of them, what was uploaded and replaced
  int64_t kept_bytes = 0;               // of what `kept` names
  int64_t preview_bytes = 0;            // of the pictures that its events name

  // JSON, opaque to the store; empty: none. See server/jobs/codec.h.
  std::string webhook;  // who is told of its end
  std::string kept;     // what the engine left for later runs, the newest snapshot among it
  std::string options;
  std::string policy;
  std::string progress;
  std::string error;
  std::string report;
};

// Stored as numbers: never change or reuse them.
enum class FileRole {
  kPhoto = 1,
  kCameras = 2,
  kDepth = 3,
  kColmap = 4,
  kArchive = 5,
  kMask = 6,
  kVideo = 7,
};

inline bool GivesCameras(FileRole role) {
  return role == FileRole::kCameras || role == FileRole::kColmap;
}

struct FileRecord {
  std::string name;
  FileRole role = FileRole::kPhoto;
  int64_t size_bytes = 0;
  std::string sha256;      // 64 hex digits
  int width = 0;           // px; photos, masks and videos only
  int height = 0;          // px; the same
  std::string about = {};  // what was found in it, for those who wrote it; opaque to the store
};

// How many files a job has.
struct FileTally {
  int64_t files = 0;       // all of them
  int64_t same_bytes = 0;  // those of the digest that was asked for
};

// A file and the job it belongs to.
struct JobFile {
  std::string job_id;
  FileRecord file;
};

// Stored as numbers: never change or reuse them.
enum class EventKind { kState = 1, kProgress = 2, kSnapshot = 3 };

struct EventRecord {
  int64_t number = 0;  // 1, 2, 3, ... per job, without gaps
  int64_t time_ms = 0;
  EventKind kind = EventKind::kState;
  std::string payload;  // JSON, opaque to the store
};

// Stored as numbers: never change or reuse them.
enum class LogSeverity { kInfo = 1, kWarning = 2, kError = 3 };

// What happened in a job, for a human.
struct LogEntry {
  int64_t number = 0;  // 1, 2, 3, ... per job, without gaps
  int64_t time_ms = 0;
  LogSeverity severity = LogSeverity::kInfo;
  std::string text;  // may have several lines
};

// What one owner's jobs amount to.
struct OwnerUsage {
  int64_t jobs = 0;
  // Of all their files, replaced ones that are still there included, and of what their runs left:
  // checkpoints, scenes, previews.
  int64_t bytes = 0;
};

// The jobs that wait for a worker, and how many each owner has running.
struct JobQueue {
  struct Job {
    std::string id;
    std::string owner;
    int priority = 0;
    int64_t queue_time_ms = 0;
  };
  std::vector<Job> waiting;  // by priority, then time
  std::map<std::string, int64_t> running;
};

// Which jobs of a list come first; see JobStore::List().
enum class ListOrder { kNewestFirst, kOldestFirst };

// All jobs, for whoever watches over the service.
struct JobCensus {
  std::map<JobState, int64_t> by_state;            // states without jobs are left out
  int64_t oldest_queue_time_ms = 0;                // of the queued jobs; 0: there are none
  std::map<std::string, int64_t> queued_by_needs;  // how many queued jobs have which needs
  std::vector<std::string> running_progress;       // JobRecord::progress of each running job
};

// A worker that said that it is there.
struct WorkerRecord {
  std::string name;
  int64_t seen_ms = 0;    // when it said so last
  std::string resources;  // what it has: JSON, opaque to the store
};

// One job inside a transaction. Nothing is visible to others, and nothing is on disk, until the
// transaction's function has returned OK.
class JobTransaction {
 public:
  virtual ~JobTransaction() = default;

  // The job as it is; changes are written back at the end. `id`, `owner`, `photos` and `bytes` are
  // ignored.
  JobRecord job;

  virtual absl::StatusOr<std::vector<FileRecord>> Files() = 0;
  // As the calls of JobStore: without reading all rows.
  virtual absl::StatusOr<std::optional<FileRecord>> File(FileRole role, std::string_view name) = 0;
  virtual absl::StatusOr<FileTally> Tally(std::string_view sha256) = 0;
  // What the job counts in OwnerUsage::bytes, with what this transaction changed so far.
  virtual int64_t Bytes() const = 0;
  // Of the job's owner, with what this transaction changed so far: reads the rows of all its jobs.
  virtual absl::StatusOr<OwnerUsage> Usage() = 0;
  // Adds the file or replaces that of the same role and name.
  virtual absl::Status PutFile(const FileRecord& file) = 0;
  // Nothing happens where there is no such file.
  virtual absl::Status RemoveFile(FileRole role, std::string_view name) = 0;
  virtual absl::Status RemoveFiles(FileRole role) = 0;
  // Appends an event with the next number; `number` is ignored.
  virtual absl::Status AddEvent(const EventRecord& event) = 0;
  // Appends to the log with the next number; `number` is ignored.
  virtual absl::Status AddLog(const LogEntry& entry) = 0;
  // Removes the job with its files, events and log.
  virtual absl::Status Remove() = 0;
};

// What can be waited for.
enum class ChangeTopic {
  kJobs,   // an event or a log's entry of any job, or its removal
  kQueue,  // a job that waits for a worker
};

// Thread-safe. Several processes may hold a store on the same data. An OK answer to a change means
// that the change survives a crash of any process and of the machine.
//
// Errors of every call: NOT_FOUND (JOB_NOT_FOUND) for an unknown id; RESOURCE_EXHAUSTED
// (DISK_FULL); DATA_LOSS (STORE_CORRUPT); INTERNAL (STORE_FAILED) for whatever else the store
// meets. A store on another machine, beside these: UNAVAILABLE, with nothing changed
// (STORE_UNAVAILABLE, STORE_BUSY), or with the connection lost in a commit and the database away
// since, so that nobody knows (STORE_OUTCOME_UNKNOWN).
//
// These are the calls that a client's jobs need: see ClientJobStore.
class ClientStore {
 public:
  using Change = absl::FunctionRef<absl::Status(JobTransaction&)>;

  virtual ~ClientStore() = default;

  // Inserts the job and applies `change` to it in the same transaction. If a job of the same
  // owner with the same non-empty request_id exists, returns that one instead, unchanged;
  // UNAVAILABLE (JOB_BUSY) if that one was deleted meanwhile.
  virtual absl::StatusOr<JobRecord> Create(const JobRecord& job, Change change) = 0;

  virtual absl::StatusOr<JobRecord> Get(std::string_view id) = 0;

  // The job of this owner and request_id; nullopt if there is none.
  virtual absl::StatusOr<std::optional<JobRecord>> FindRequest(const std::string& owner,
                                                               const std::string& request_id) = 0;

  // By creation time, then id. Starts after job `after_id` that was created at `after_time_ms`; 0
  // and "" for the first page. Only jobs of `owner`; nullopt: of all.
  virtual absl::StatusOr<std::vector<JobRecord>> List(
      int64_t after_time_ms, std::string_view after_id, int limit,
      const std::optional<std::string>& owner = std::nullopt,
      ListOrder order = ListOrder::kNewestFirst) = 0;

  // Applies `change` to a job, alone: no other change of the job happens between what the function
  // sees and what it writes. Its error is returned and leaves the job as it was. It may be called
  // more than once, so it must have no effect but on the transaction.
  virtual absl::StatusOr<JobRecord> Update(std::string_view id, Change change) = 0;

  virtual absl::StatusOr<JobQueue> Queue() = 0;

  // The workers that were seen at `since_ms` or later, by name.
  virtual absl::StatusOr<std::vector<WorkerRecord>> Workers(int64_t since_ms) = 0;

  // By role, then name.
  virtual absl::StatusOr<std::vector<FileRecord>> Files(std::string_view id) = 0;

  // The file of this role and name; nullopt if there is none.
  virtual absl::StatusOr<std::optional<FileRecord>> File(std::string_view id, FileRole role,
                                                         std::string_view name) = 0;
  virtual absl::StatusOr<FileTally> Tally(std::string_view id, std::string_view sha256) = 0;

  // A file with these bytes and this role in any job of the owner of job `id`, `id` itself
  // included; nullopt if there is none.
  virtual absl::StatusOr<std::optional<JobFile>> FindFile(std::string_view id, FileRole role,
                                                          std::string_view sha256) = 0;

  // What the jobs of this owner amount to.
  virtual absl::StatusOr<OwnerUsage> UsageOf(std::string_view owner) = 0;
  // Ids of this owner's jobs that take files.
  virtual absl::StatusOr<std::vector<std::string>> Uploading(std::string_view owner) = 0;

  // Events with numbers above `after`, in order, at most `limit`.
  virtual absl::StatusOr<std::vector<EventRecord>> Events(std::string_view id, int64_t after,
                                                          int limit) = 0;

  // Entries of its log with numbers above `after`, in order, at most `limit`.
  virtual absl::StatusOr<std::vector<LogEntry>> Log(std::string_view id, int64_t after,
                                                    int limit) = 0;

  // Returns once there was a change since the call that returned `seen`, whichever process made it,
  // and after `seconds` at the latest. What it returns differs from `seen` if there was one; it may
  // differ without. A change is seen a moment after it was made. -1 is never returned.
  virtual absl::StatusOr<int64_t> WaitForChange(ChangeTopic topic, int64_t seen,
                                                double seconds) = 0;

  // OK if changes can be made: a database may take none and still be read.
  virtual absl::Status CheckWritable() { return absl::OkStatus(); }

  // Milliseconds since 1970 by the clock that all users of the store share; leases are timed by it.
  virtual int64_t NowMs() = 0;

  // The time since which workers can have renewed their leases, as far as is known here; 0: always.
  // Leases that ran out while nobody reached the store do not show that their workers are dead.
  virtual int64_t ReachableSinceMs() = 0;
};

// What workers, and those who look after all jobs, need as well.
class JobStore : public ClientStore {
 public:
  // Whether a worker has what JobRecord::needs says. Asked once for each text that is in the queue.
  using Fits = absl::FunctionRef<bool(std::string_view needs)>;

  // Update() of the first queued job whose needs fit: of those of the highest priority, one of the
  // owner with the fewest running jobs, who then waits longest (queue_time_ms); nullopt if there is
  // none. Changes at the same time do not see each other's choice, so that an owner may get as many
  // jobs too early as there are.
  virtual absl::StatusOr<std::optional<JobRecord>> UpdateFirstQueued(Fits fits, Change change) = 0;

  // Update() of one running job whose lease ended before `now_ms`; nullopt if there is none.
  virtual absl::StatusOr<std::optional<JobRecord>> UpdateFirstExpired(int64_t now_ms,
                                                                      Change change) = 0;

  // Update() of one running job whose lease ends after `latest_ms`; nullopt if there is none.
  virtual absl::StatusOr<std::optional<JobRecord>> UpdateFirstLeasedBeyond(int64_t latest_ms,
                                                                           Change change) = 0;

  // Ids of the running jobs leased to `owner`.
  virtual absl::StatusOr<std::vector<std::string>> LeasedTo(std::string_view owner) = 0;

  // Ids of the jobs whose expire_time_ms has come; at most `limit`, oldest first.
  virtual absl::StatusOr<std::vector<std::string>> Expired(int64_t now_ms, int limit) = 0;

  // Ids of the jobs whose webhook_due_ms has come, or is after `latest_ms`, of each owner the
  // oldest; at most `limit`, oldest first.
  virtual absl::StatusOr<std::vector<std::string>> WebhooksDue(int64_t now_ms, int64_t latest_ms,
                                                               int limit) = 0;

  // Jobs that have unreferenced blobs and neither take files nor run nor wait to.
  virtual absl::StatusOr<std::vector<std::string>> JobsWithUnreferencedBlobs(int limit) = 0;

  virtual absl::StatusOr<JobCensus> Census() = 0;

  // Workers say that they are there, and are forgotten by their names. Nobody waits for that.
  virtual absl::Status PutWorker(const WorkerRecord& worker) = 0;
  virtual absl::Status RemoveWorker(std::string_view name) = 0;

  // 32 hex digits, made at the first call and the same from then on, also in a copy of the database
  // and in the store that an installation was moved to.
  virtual absl::StatusOr<std::string> InstallationId() = 0;
};

// NowMs() of a store that outlives the clock.
Clock StoreClock(ClientStore* store);

// NOT_FOUND (JOB_NOT_FOUND), for a job that is not there, and for one that is none of the caller's.
absl::Status JobNotFound(std::string_view id);

// Reads all of an SQLite job store, a second or so per 500 MB, and says whether it is whole; one
// that is not there is. DATA_LOSS (STORE_CORRUPT); FAILED_PRECONDITION (STORE_TOO_NEW,
// STORE_TOO_OLD) if another version of the program wrote it.
absl::Status CheckSqliteJobStore(const std::string& path);

// An SQLite file, made if it is not there. FAILED_PRECONDITION (STORE_TOO_NEW, STORE_TOO_OLD) if
// another version of the program wrote it.
absl::StatusOr<std::unique_ptr<JobStore>> OpenSqliteJobStore(const std::string& path);

// A database of a PostgreSQL server of version 13 or later: a libpq URL or connection string.
// Tables are made in it if they are not there. FAILED_PRECONDITION (STORE_NOT_OPENED: a missing
// right; STORE_TOO_NEW, STORE_TOO_OLD), UNAVAILABLE (STORE_UNAVAILABLE).
absl::StatusOr<std::unique_ptr<JobStore>> OpenPostgresJobStore(const std::string& url);

}  // namespace litags

#endif  // LITAGS_SERVER_STORE_JOB_STORE_H_
