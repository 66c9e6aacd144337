#include "server/jobs/sweeper.h"

#include <spdlog/spdlog.h>
#include <unistd.h>

#include <algorithm>
#include <cstdlib>
#include <fstream>
#include <map>
#include <set>
#include <utility>

#include "absl/strings/str_cat.h"
#include "engine/core/counted.h"
#include "engine/core/error.h"
#include "server/jobs/codec.h"
#include "server/jobs/state_machine.h"
#include "server/jobs/sweep_mark.h"
#include "server/jobs/transition.h"
#include "server/store/digest.h"

namespace litags {
namespace {

constexpr int kJobsPerSweep = 1000;
constexpr int kEventsPerRead = 1000;
constexpr int kRowsPerRead = 1000;
constexpr int kLooksForOrphans = 24;            // while one is kept
constexpr int64_t kWebhookMs = 25 * 3'600'000;  // longer than its attempts take
constexpr int64_t kAfterAttemptMs = 120'000;    // longer than one takes
constexpr int64_t kLostMs = 60'000;             // less between two clocks is nothing
// While the service was away, nobody could send a file: uploads are kept at least this part of
// keep_seconds after its start. Not all of it, or a service that restarts daily removed none.
constexpr double kKeptAfterStart = 0.5;

// As RandomHex(8) makes them. Other names in our folders are not ours.
bool IsJobId(const std::string& name) {
  return name.size() == 16 && name.find_first_not_of("0123456789abcdef") == std::string::npos;
}

bool IsNumber(const std::string& name) {
  return !name.empty() && name.find_first_not_of("0123456789") == std::string::npos;
}

// Calls `remove` for each id. Where it fails, the others have their turn, but if a store is away:
// it is for them, too. Returns the first error; jobs that were deleted meanwhile, or change, are
// none.
absl::Status ForEach(const std::vector<std::string>& ids, const CancelToken& stop,
                     absl::FunctionRef<absl::Status(const std::string&)> remove) {
  absl::Status first;
  for (const std::string& id : ids) {
    if (stop.IsCancelled()) break;
    const absl::Status status = remove(id);
    if (absl::IsNotFound(status) || absl::IsAborted(status)) continue;
    first.Update(status);
    if (absl::IsUnavailable(status)) break;
  }
  return first;
}

// The job goes on, or another server sweeps it: it has its turn later.
absl::Status SweptByAnother(std::string_view id) {
  return absl::AbortedError(absl::StrCat("jobs/", std::string(id), " changes"));
}

// A line "ID MILLISECONDS" for each job that is missed. What cannot be read or was written in part
// is forgotten: files are kept the longer for it.
std::map<std::string, int64_t> ReadMissed(const std::string& path) {
  std::map<std::string, int64_t> missed_ms;
  std::ifstream file(path);
  std::string id;
  for (int64_t ms = 0; file >> id >> ms;) missed_ms[id] = ms;
  return missed_ms;
}

void WriteMissed(const std::string& path, const std::map<std::string, int64_t>& missed_ms) {
  if (missed_ms.empty()) {
    unlink(path.c_str());
    return;
  }
  std::ofstream file(path);
  for (const auto& [id, ms] : missed_ms) file << id << " " << ms << "\n";
}

// Until when its end may still be to be told: attempts end before, and without a server that makes
// them nobody waits for ever.
bool WaitsForWebhook(const JobRecord& job, int64_t now_ms) {
  return IsTerminal(job.state) && job.webhook_due_ms > 0 && now_ms < job.end_time_ms + kWebhookMs;
}

}  // namespace

Sweeper::Sweeper(JobStore* store, BlobStore* blobs, Uploads* uploads, DataDir data, Clock clock,
                 const InstallationMarker* marker, Clock awake_ms)
    : store_(store),
      blobs_(blobs),
      uploads_(uploads),
      data_(std::move(data)),
      clock_(clock ? std::move(clock) : StoreClock(store)),
      awake_ms_(awake_ms ? std::move(awake_ms) : clock_),
      marker_(marker),
      now_ms_(clock_()),
      started_ms_(now_ms_),
      ahead_ms_(now_ms_ - awake_ms_()) {}

// Where the two clocks have parted, the machine slept, or the clock was set. Waking up is a start;
// no server ran meanwhile.
void Sweeper::NoteTime() {
  const int64_t awake_ms = awake_ms_();
  now_ms_ = clock_();
  const int64_t ahead_ms = now_ms_ - awake_ms;
  const int64_t lost_ms = ahead_ms - std::exchange(ahead_ms_, ahead_ms);
  std::erase_if(jumps_,
                [&](const Jump& jump) { return awake_ms >= jump.awake_ms + KeptAfterStartMs(); });
  if (std::abs(lost_ms) <= kLostMs) return;
  spdlog::info("the clock has jumped by {} s: that counts as time without a server",
               lost_ms / 1000);
  started_ms_ = now_ms_;
  jumps_.push_back({now_ms_, lost_ms, awake_ms});
  for (auto& [id, since_ms] : missed_since_ms_) since_ms += lost_ms;
}

int64_t Sweeper::KeptAfterStartMs() const {
  return static_cast<int64_t>(1000 * kKeptAfterStart * uploads_->limits().keep_seconds);
}

// Before that a job is not removed, whatever its row says.
int64_t Sweeper::LeastExpiry(const JobRecord& job) const {
  if (WaitsForWebhook(job, now_ms_)) return std::max(job.webhook_due_ms, now_ms_) + kAfterAttemptMs;
  if (job.state != JobState::kUploading) return 0;
  return std::max(started_ms_, store_->ReachableSinceMs()) + KeptAfterStartMs();
}

// By how much a clock that may be wrong, and be set right again, has gone on too fast since the job
// ended. It can be told from a sleep no better than an operator can: after KeptAfterStartMs() it is
// taken as right.
int64_t Sweeper::JumpedSinceEndMs(const JobRecord& job) const {
  int64_t by_ms = 0;
  for (auto jump = jumps_.rbegin(); jump != jumps_.rend(); ++jump) {
    if (job.end_time_ms > jump->at_ms) break;  // it ended between this one and the next
    by_ms += jump->by_ms;
  }
  return by_ms;
}

absl::Status Sweeper::RemoveExpired(const std::string& id, std::vector<std::string>* expired) {
  if (uploads_->partials().InUse(id)) return absl::OkStatus();
  bool removed = false;
  const auto change = [&](JobTransaction& job) -> absl::Status {
    // A sign of life may have come since the list was made.
    removed = job.job.expire_time_ms > 0 && job.job.expire_time_ms <= now_ms_ &&
              NextState(job.job.state, JobAction::kRemove).ok();
    // Its row stays as it is: with the clock set right again, it says when.
    if (removed && IsTerminal(job.job.state) &&
        job.job.expire_time_ms > now_ms_ - JumpedSinceEndMs(job.job)) {
      removed = false;
      return absl::AbortedError(absl::StrCat("jobs/", id, " is kept after a jump of the clock"));
    }
    const int64_t least_ms = LeastExpiry(job.job);
    if (removed && now_ms_ < least_ms) {
      removed = false;
      job.job.expire_time_ms = least_ms;
    }
    return removed ? job.Remove() : absl::OkStatus();
  };
  LITAGS_RETURN_IF_ERROR(store_->Update(id, change).status());
  if (!removed) return absl::OkStatus();
  spdlog::info("job={} expired and was removed", id);
  expired->push_back(id);
  return uploads_->RemoveAllOf(id);
}

// Names of the folders of jobs, in the blob store and of files on their way.
absl::StatusOr<std::set<std::string>> Sweeper::JobFolders() {
  LITAGS_ASSIGN_OR_RETURN(const auto partials, ListFolder(data_.uploads()));
  LITAGS_ASSIGN_OR_RETURN(const auto blobs, blobs_->List("jobs"));
  LITAGS_ASSIGN_OR_RETURN(const auto chunks, uploads_->partials().chunks().Jobs());
  std::set<std::string> names(blobs.begin(), blobs.end());
  names.insert(chunks.begin(), chunks.end());
  for (const FolderEntry& entry : partials) names.insert(entry.name);
  std::erase_if(names, [](const std::string& name) { return !IsJobId(name); });
  return names;
}

// Whether no other installation can own what is not in our job store. A server looked when it
// started; the marker may have changed since.
bool Sweeper::OrphansAreOurs(size_t orphans) {
  if (!marker_ || orphans == 0) return true;
  const absl::Status ours = marker_->Check();
  if (ours.ok()) return true;
  spdlog::warn("files of {} without a row in the job store are kept: {}", Counted(orphans, "job"),
               std::string(ours.message()));
  return false;
}

// A row is there before its folders are: a folder without one was left behind by a crash, or its
// row was lost, as with the wrong job store or an old copy of it. The delay, from the moment at
// which the row was first missed, is the operator's time to bring the row back. Only time in which
// a server runs, and says so, counts.
absl::Status Sweeper::RemoveOrphans(const CancelToken& stop) {
  const int64_t now_ms = now_ms_;
  const double keep_seconds = uploads_->limits().keep_seconds;
  const int64_t pause_ms = static_cast<int64_t>(1000 * keep_seconds / kLooksForOrphans);
  const auto& seen_ms = orphans_seen_ms_;
  if (seen_ms && *seen_ms <= now_ms && now_ms < *seen_ms + pause_ms) return absl::OkStatus();
  LITAGS_ASSIGN_OR_RETURN(std::set<std::string> orphans, JobsWithoutRow(stop));
  if (stop.IsCancelled()) return absl::OkStatus();
  const bool is_first = !seen_ms;
  if (is_first) {  // what the server before this one knew
    for (const auto& [id, ms] : ReadMissed(data_.missed())) missed_since_ms_[id] = now_ms - ms;
  }
  orphans_seen_ms_ = now_ms;
  if (!OrphansAreOurs(orphans.size())) orphans.clear();
  std::map<std::string, int64_t> missed, missed_ms;
  bool is_news = is_first && !orphans.empty();
  for (const std::string& id : orphans) {
    const auto before = missed_since_ms_.find(id);
    const bool is_new = before == missed_since_ms_.end();
    missed[id] = is_new ? now_ms : before->second;
    missed_ms[id] = now_ms - missed[id];
    is_news |= is_new;
  }
  if (is_news) {
    spdlog::warn(
        "jobs that have files are not in the job store: {}, jobs/{} the first; their files are "
        "removed after {:.1f} hours; if this is the wrong job store, or an old copy, put the right "
        "one back before",
        missed.size(), missed.begin()->first, keep_seconds / 3600);
  }
  missed_since_ms_ = std::move(missed);
  WriteMissed(data_.missed(), missed_ms);
  std::vector<std::string> overdue;
  for (const auto& [id, since_ms] : missed_since_ms_) {
    if (static_cast<double>(now_ms - since_ms) >= 1000 * keep_seconds) overdue.push_back(id);
  }
  return ForEach(overdue, stop, [&](const std::string& id) { return RemoveOrphan(id); });
}

// Jobs that have folders. Rows are read by the page: one by one, each of them would cost the store
// a transaction.
absl::StatusOr<std::set<std::string>> Sweeper::JobsWithoutRow(const CancelToken& stop) {
  LITAGS_ASSIGN_OR_RETURN(std::set<std::string> folders, JobFolders());
  int64_t after_ms = 0;
  std::string after_id;
  while (!folders.empty() && !stop.IsCancelled()) {
    LITAGS_ASSIGN_OR_RETURN(const auto jobs, store_->List(after_ms, after_id, kRowsPerRead,
                                                          std::nullopt, ListOrder::kOldestFirst));
    for (const JobRecord& job : jobs) folders.erase(job.id);
    if (jobs.size() < static_cast<size_t>(kRowsPerRead)) break;
    after_ms = jobs.back().create_time_ms;
    after_id = jobs.back().id;
  }
  return folders;
}

absl::Status Sweeper::RemoveOrphan(const std::string& id) {
  const absl::Status row = store_->Get(id).status();
  if (!absl::IsNotFound(row)) return row;  // it is back
  LITAGS_ASSIGN_OR_RETURN(const double blob_seconds,
                          blobs_->QuietSeconds(absl::StrCat("jobs/", id)));
  LITAGS_ASSIGN_OR_RETURN(const double chunk_seconds,
                          uploads_->partials().chunks().QuietSeconds(id));
  if (std::min(blob_seconds, chunk_seconds) < uploads_->limits().keep_seconds) {
    return absl::OkStatus();
  }
  LITAGS_RETURN_IF_ERROR(uploads_->RemoveAllOf(id));
  spdlog::warn("job={} is not in the job store; its files were removed", id);
  return absl::OkStatus();
}

// What was on its way into jobs that do not take files any more.
absl::Status Sweeper::RemoveEndedUploads(const CancelToken& stop) {
  LITAGS_ASSIGN_OR_RETURN(const auto partials, ListFolder(data_.uploads()));
  LITAGS_ASSIGN_OR_RETURN(const auto chunks, uploads_->partials().chunks().Jobs());
  std::set<std::string> uploading(chunks.begin(), chunks.end());
  for (const FolderEntry& entry : partials) uploading.insert(entry.name);
  std::erase_if(uploading, [](const std::string& name) { return !IsJobId(name); });
  return ForEach({uploading.begin(), uploading.end()}, stop, [&](const std::string& id) {
    const auto job = store_->Get(id);
    if (!job.ok() || job->state == JobState::kUploading) return absl::OkStatus();
    return uploads_->RemovePartialsOf(id);
  });
}

// What is in the job's folder of the blob store.
absl::StatusOr<Sweeper::JobBlobs> Sweeper::BlobsOf(const std::string& id) {
  const std::string folder = absl::StrCat("jobs/", id);
  LITAGS_ASSIGN_OR_RETURN(const auto names, blobs_->List(folder));
  JobBlobs blobs;
  for (const std::string& name : names) {
    if (IsDigest(name)) {
      blobs.uploaded.insert(name);
    } else if (IsNumber(name)) {
      LITAGS_ASSIGN_OR_RETURN(blobs.of_leases[name], blobs_->List(absl::StrCat(folder, "/", name)));
    }
  }
  return blobs;
}

// Of files that were replaced or refused while the job took files, and of a worker that died or
// lost its lease, there may be blobs that no row names. While a job takes no files and does not
// run, nobody can come to name such a blob, since no lease stores under another one's keys: what is
// not named now is of no use to anybody.
absl::Status Sweeper::RemoveUnreferencedBlobs(const std::string& id) {
  LITAGS_ASSIGN_OR_RETURN(const JobBlobs blobs, BlobsOf(id));
  // After the list: a job that does not run now has stored nothing since.
  LITAGS_ASSIGN_OR_RETURN(const JobRecord job, store_->Get(id));
  if (job.state == JobState::kUploading || job.state == JobState::kQueued ||
      job.state == JobState::kRunning) {
    return absl::OkStatus();
  }
  LITAGS_ASSIGN_OR_RETURN(const std::set<std::string> named, BlobsNamedBy(job));
  LITAGS_RETURN_IF_ERROR(RemoveUnreferencedUploads(id, blobs.uploaded));
  const std::string folder = absl::StrCat("jobs/", id);
  for (const auto& [lease, digests] : blobs.of_leases) {
    // The copy is for clang 14, which takes no structured binding by reference.
    const auto is_named = [&named, lease = lease](const std::string& sha256) {
      return named.contains(absl::StrCat(lease, "/", sha256));
    };
    if (std::none_of(digests.begin(), digests.end(), is_named)) {
      LITAGS_RETURN_IF_ERROR(blobs_->RemoveFolder(absl::StrCat(folder, "/", lease)));
      continue;
    }
    for (const std::string& sha256 : digests) {
      if (is_named(sha256)) continue;
      LITAGS_RETURN_IF_ERROR(blobs_->Remove(absl::StrCat(folder, "/", lease, "/", sha256)));
    }
  }
  bool cleared = false;
  const auto clear = [&](JobTransaction& now) {
    cleared = now.job.last_event == job.last_event;
    if (!cleared) return absl::OkStatus();
    now.job.has_unreferenced_blobs = false;
    now.job.unreferenced_bytes = 0;
    return absl::OkStatus();
  };
  LITAGS_RETURN_IF_ERROR(store_->Update(id, clear).status());
  return cleared ? NoteBlobsBut(named, id) : absl::OkStatus();
}

// Whoever stores a blob that nothing names says so after. Who said so while others were removed is
// heard here: the blob was there when the note of it was cleared. One that was named since is
// noted, too, which costs a look.
absl::Status Sweeper::NoteBlobsBut(const std::set<std::string>& named, const std::string& id) {
  const auto blobs = BlobsOf(id);
  if (blobs.ok()) {
    std::set<std::string> there = blobs->uploaded;
    for (const auto& [lease, digests] : blobs->of_leases) {
      for (const std::string& sha256 : digests) there.insert(absl::StrCat(lease, "/", sha256));
    }
    if (std::includes(named.begin(), named.end(), there.begin(), there.end())) {
      return absl::OkStatus();
    }
  }
  absl::Status status = blobs.status();
  status.Update(NoteUnreferencedBlobsOf(*store_, id));
  return status;
}

// A FAILED job may take files again, which may have the digest of an old one: not while the mark of
// sweep_mark.h is there. Blobs are removed outside of transactions, since a blob store that is away
// would stop the job store.
absl::Status Sweeper::RemoveUnreferencedUploads(const std::string& id,
                                                std::set<std::string> digests) {
  const std::string mark = absl::StrCat(kSweepMark, RandomHex(8));
  absl::Status status;
  while (status.ok() && !digests.empty()) {
    LITAGS_RETURN_IF_ERROR(MarkSwept(id, mark, &digests));
    const int64_t until_ms = clock_() + kSweepMarkMs / 4;
    while (status.ok() && !digests.empty() && clock_() < until_ms) {
      LITAGS_ASSIGN_OR_RETURN(const JobRecord job, store_->Get(id));
      if (job.lease_owner != mark) return SweptByAnother(id);
      status = blobs_->Remove(BlobKey(id, *digests.begin()));
      digests.erase(digests.begin());
    }
  }
  // What a store that is away was told it may still do when it is back: the mark ends by itself.
  if (absl::IsUnavailable(status)) return status;
  const auto unmark = [&](JobTransaction& job) {
    if (job.job.lease_owner == mark) job.job.lease_owner.clear();
    return absl::OkStatus();
  };
  status.Update(store_->Update(id, unmark).status());
  return status;
}

// Leaves in `digests` those that no file of the job has, and marks the job if there are any.
absl::Status Sweeper::MarkSwept(const std::string& id, const std::string& mark,
                                std::set<std::string>* digests) {
  const auto change = [&](JobTransaction& job) -> absl::Status {
    const bool is_others = job.job.lease_owner != mark && IsBeingSwept(job.job, clock_());
    if (is_others || !IsTerminal(job.job.state)) return SweptByAnother(id);
    LITAGS_ASSIGN_OR_RETURN(const auto files, job.Files());
    for (const FileRecord& file : files) digests->erase(file.sha256);
    if (digests->empty()) return absl::OkStatus();
    job.job.lease_owner = mark;
    job.job.lease_expires_ms = clock_() + kSweepMarkMs;
    return absl::OkStatus();
  };
  return store_->Update(id, change).status();
}

absl::StatusOr<std::set<std::string>> Sweeper::BlobsNamedBy(const JobRecord& job) {
  std::set<std::string> named;
  LITAGS_ASSIGN_OR_RETURN(const auto files, store_->Files(job.id));
  for (const FileRecord& file : files) named.insert(file.sha256);
  if (!job.kept.empty()) {
    LITAGS_ASSIGN_OR_RETURN(const KeptFiles kept, Decode<KeptFiles>(job.kept));
    for (const auto& [name, file] : kept) named.insert(file.blob);
  }
  for (int64_t last = 0; last < job.last_event;) {
    LITAGS_ASSIGN_OR_RETURN(const auto events, store_->Events(job.id, last, kEventsPerRead));
    if (events.empty()) break;
    last = events.back().number;
    for (const EventRecord& event : events) {
      if (event.kind != EventKind::kProgress) continue;
      LITAGS_ASSIGN_OR_RETURN(const auto record, Decode<ProgressRecord>(event.payload));
      named.insert(record.preview);
    }
  }
  return named;
}

absl::Status Sweeper::RemoveAllExpired(const CancelToken& stop, std::vector<std::string>* expired) {
  LITAGS_ASSIGN_OR_RETURN(const auto ids, store_->Expired(now_ms_, kJobsPerSweep));
  return ForEach(ids, stop, [&](const std::string& id) { return RemoveExpired(id, expired); });
}

absl::Status Sweeper::RemoveAllUnreferencedBlobs(const CancelToken& stop) {
  LITAGS_ASSIGN_OR_RETURN(const auto ids, store_->JobsWithUnreferencedBlobs(kJobsPerSweep));
  return ForEach(ids, stop, [&](const std::string& id) { return RemoveUnreferencedBlobs(id); });
}

absl::StatusOr<std::vector<std::string>> Sweeper::Sweep(const CancelToken& stop) {
  const std::lock_guard lock(mutex_);
  NoteTime();
  std::vector<std::string> expired;
  absl::Status status;
  // A store that is away may cost each step half a minute, and a server that is to end has less.
  bool goes_on = true;
  const auto step = [&](absl::FunctionRef<absl::Status()> remove) {
    if (!goes_on || stop.IsCancelled()) return;
    const absl::Status removed = remove();
    goes_on = !absl::IsUnavailable(removed);
    status.Update(removed);
  };
  step([&] { return RemoveAllExpired(stop, &expired); });
  step([&] { return RemoveOrphans(stop); });
  step([&] { return RemoveEndedUploads(stop); });
  step([&] { return RemoveAllUnreferencedBlobs(stop); });
  step([&] {
    blobs_->RemoveTemporary();
    return absl::OkStatus();
  });
  data_.EmptyTmp(uploads_->limits().keep_seconds);
  LITAGS_RETURN_IF_ERROR(status);
  return expired;
}

}  // namespace litags
