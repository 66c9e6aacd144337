#include "server/jobs/leases.h"

#include <algorithm>
#include <cstdlib>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_replace.h"
#include "engine/core/error.h"
#include "engine/core/utf8.h"
#include "server/jobs/transition.h"
#include "server/store/digest.h"

namespace litags {
namespace {

constexpr int64_t kJumpMs = 4000;  // less between two clocks is no sleep, and costs no lease

absl::Status CheckHeld(const JobRecord& job, const Lease& lease) {
  if (job.state == JobState::kRunning && job.lease_owner == lease.owner &&
      job.attempt == lease.job.attempt && job.lease_start_ms == lease.job.lease_start_ms) {
    return absl::OkStatus();
  }
  return MakeError(absl::StatusCode::kAborted, "LEASE_LOST", "",
                   absl::StrCat("jobs/", job.id, " is no longer leased to ", lease.owner));
}

absl::Status LostIfGone(const absl::Status& status, const Lease& lease) {
  if (!absl::IsNotFound(status)) return status;
  return MakeError(absl::StatusCode::kAborted, "LEASE_LOST", "",
                   absl::StrCat("jobs/", lease.job.id, " was deleted"));
}

// PostgreSQL and Protobuf take no other text.
std::string ValidText(std::string_view text) {
  return absl::StrReplaceAll(Utf8Prefix(text, std::string::npos),
                             {{std::string(1, '\0'), "\uFFFD"}});
}

}  // namespace

Leases::Leases(JobStore* store, BlobStore* blobs, LeaseOptions options, Clock clock, Clock awake_ms)
    : store_(store),
      blobs_(blobs),
      options_(options),
      clock_(clock ? clock : StoreClock(store)),
      awake_ms_(awake_ms ? std::move(awake_ms)
                : clock  ? clock
                         : AwakeClockMs),
      watched_ms_(clock_()) {
  ahead_ms_ = watched_ms_ - awake_ms_();
}

absl::Status Leases::ShortenImpossibleLeases() {
  const int64_t latest_ms = clock_() + options_.duration_ms;
  for (;;) {
    LITAGS_ASSIGN_OR_RETURN(const auto job,
                            store_->UpdateFirstLeasedBeyond(latest_ms, [&](JobTransaction& job) {
                              job.job.lease_expires_ms = latest_ms;
                              return absl::OkStatus();
                            }));
    if (!job) return absl::OkStatus();
  }
}

int64_t Leases::RenewableSinceMs() {
  std::lock_guard lock(mutex_);
  const int64_t now_ms = clock_(), ahead_ms = now_ms - awake_ms_();
  if (std::abs(ahead_ms - ahead_ms_) > kJumpMs) watched_ms_ = now_ms;
  ahead_ms_ = ahead_ms;
  return std::max(watched_ms_, store_->ReachableSinceMs());
}

absl::Status Leases::AbandonStale() {
  if (clock_() - RenewableSinceMs() < options_.duration_ms) return absl::OkStatus();
  for (;;) {
    LITAGS_ASSIGN_OR_RETURN(
        const auto expired, store_->UpdateFirstExpired(clock_(), [&](JobTransaction& job) {
          return Abandon(job, absl::StrCat("worker ", job.job.lease_owner, " was not heard of"));
        }));
    if (!expired) return absl::OkStatus();
  }
}

absl::Status Leases::TakeBackLost() {
  LITAGS_RETURN_IF_ERROR(ShortenImpossibleLeases());
  return AbandonStale();
}

absl::StatusOr<std::optional<Lease>> Leases::Acquire(const std::string& owner,
                                                     const Resources& has) {
  LITAGS_RETURN_IF_ERROR(TakeBackLost());
  const auto take = [&](JobTransaction& job) -> absl::Status {
    ++job.job.attempt;
    LITAGS_RETURN_IF_ERROR(ApplyAction(
        job, JobAction::kLease, clock_(),
        job.job.attempt > 1 ? absl::StrCat("attempt ", job.job.attempt) : std::string()));
    job.job.lease_owner = owner;
    job.job.has_unreferenced_blobs = true;  // should this worker die
    job.job.lease_expires_ms = clock_() + options_.duration_ms;
    return absl::OkStatus();
  };
  const auto fits = [&](std::string_view needs) { return Fits(needs, has); };
  LITAGS_ASSIGN_OR_RETURN(auto job, store_->UpdateFirstQueued(fits, take));
  if (!job) return std::nullopt;
  return Lease{owner, *std::move(job)};
}

absl::StatusOr<JobRecord> Leases::Update(const Lease& lease, JobStore::Change change) {
  auto job = store_->Update(lease.job.id, [&](JobTransaction& transaction) -> absl::Status {
    LITAGS_RETURN_IF_ERROR(CheckHeld(transaction.job, lease));
    return change(transaction);
  });
  if (!job.ok()) return LostIfGone(job.status(), lease);
  return job;
}

absl::StatusOr<bool> Leases::Heartbeat(const Lease& lease, int64_t ran_ms) {
  LITAGS_ASSIGN_OR_RETURN(const JobRecord job, Update(lease, [&](JobTransaction& transaction) {
                            transaction.job.lease_expires_ms = clock_() + options_.duration_ms;
                            transaction.job.run_ms = lease.job.run_ms + ran_ms;
                            return absl::OkStatus();
                          }));
  return job.cancel_requested;
}

absl::StatusOr<bool> Leases::CancelRequested(const Lease& lease) {
  auto job = store_->Get(lease.job.id);
  if (!job.ok()) return LostIfGone(job.status(), lease);
  LITAGS_RETURN_IF_ERROR(CheckHeld(*job, lease));
  return job->cancel_requested;
}

// Whether there is a preview, and the job may keep it.
absl::StatusOr<bool> Leases::HasRoomFor(const Lease& lease, int64_t preview_bytes) {
  if (preview_bytes == 0) return false;
  const absl::StatusOr<JobRecord> job = store_->Get(lease.job.id);
  if (!job.ok()) return LostIfGone(job.status(), lease);
  return job->preview_bytes + preview_bytes <= options_.max_preview_bytes;
}

absl::Status Leases::AddProgress(const Lease& lease, const Progress& progress) {
  ProgressRecord record{progress, ""};
  record.progress.preview_png.clear();
  const auto png_bytes = static_cast<int64_t>(progress.preview_png.size());
  LITAGS_ASSIGN_OR_RETURN(const bool has_room, HasRoomFor(lease, png_bytes));
  if (has_room) {
    const std::string_view png(reinterpret_cast<const char*>(progress.preview_png.data()),
                               progress.preview_png.size());
    record.preview = LeaseBlob(lease.job.last_event, Sha256::Hex(png));
    LITAGS_RETURN_IF_ERROR(blobs_->Put(BlobKey(lease.job.id, record.preview), png));
  }
  return Update(lease,
                [&](JobTransaction& job) -> absl::Status {
                  LITAGS_RETURN_IF_ERROR(ApplyAction(job, JobAction::kReport, clock_(), ""));
                  std::string encoded = Encode(record);
                  if (job.job.progress == encoded) return absl::OkStatus();
                  job.job.progress = std::move(encoded);
                  if (has_room) job.job.preview_bytes += png_bytes;
                  return job.AddEvent({0, clock_(), EventKind::kProgress, job.job.progress});
                })
      .status();
}

absl::Status Leases::AddToLog(JobTransaction& job, const std::vector<LogEntry>& entries) {
  int64_t& bytes = job.job.log_bytes;
  for (LogEntry entry : entries) {
    entry.text = ValidText(entry.text);
    if (bytes >= options_.max_log_bytes) break;
    const bool fits = bytes + static_cast<int64_t>(entry.text.size()) < options_.max_log_bytes;
    if (!fits) entry.text = "the log is full: what comes now is not kept";
    LITAGS_RETURN_IF_ERROR(job.AddLog(entry));
    if (!fits) bytes = std::max(bytes, options_.max_log_bytes);
  }
  return absl::OkStatus();
}

absl::Status Leases::AddLog(const Lease& lease, const std::vector<LogEntry>& entries) {
  return Update(lease, [&](JobTransaction& job) { return AddToLog(job, entries); }).status();
}

absl::Status Leases::Keep(const Lease& lease, const KeptFiles& files,
                          std::optional<int> snapshot_iteration) {
  const std::string kept = Encode(files);
  return Update(lease,
                [&](JobTransaction& job) -> absl::Status {
                  LITAGS_RETURN_IF_ERROR(ApplyAction(job, JobAction::kReport, clock_(), ""));
                  const bool again = job.job.kept == kept;
                  SetKept(&job.job, files);
                  if (!snapshot_iteration ||
                      (again && job.job.snapshot_iteration == *snapshot_iteration)) {
                    return absl::OkStatus();
                  }
                  job.job.snapshot_iteration = *snapshot_iteration;
                  return job.AddEvent({0, clock_(), EventKind::kSnapshot,
                                       Encode(SnapshotRecord{*snapshot_iteration})});
                })
      .status();
}

absl::Status Leases::Succeed(const Lease& lease, const ReconstructReport& report,
                             const KeptFiles& files) {
  return Update(
             lease,
             [&](JobTransaction& job) -> absl::Status {
               if (!files.contains(kSceneFile)) {
                 return MakeError(absl::StatusCode::kInternal, "SCENE_MISSING", "",
                                  "the job ended without a stored scene; ResumeJob tries again "
                                  "from the last checkpoint");
               }
               job.job.report = Encode(report);
               SetKept(&job.job, files);
               if (job.job.snapshot_iteration != report.iterations) {
                 job.job.snapshot_iteration = report.iterations;
                 LITAGS_RETURN_IF_ERROR(job.AddEvent({0, clock_(), EventKind::kSnapshot,
                                                      Encode(SnapshotRecord{report.iterations})}));
               }
               std::vector<LogEntry> notes;
               for (const std::string& note : report.notes) {
                 notes.push_back({0, clock_(), LogSeverity::kWarning, note});
               }
               LITAGS_RETURN_IF_ERROR(AddToLog(job, notes));
               return ApplyAction(job, JobAction::kSucceed, clock_(), "");
             })
      .status();
}

absl::Status Leases::Fail(const Lease& lease, const absl::Status& error) {
  return Update(lease,
                [&](JobTransaction& job) {
                  JobError record = JobError::Of(error);
                  record.message = ValidText(record.message);
                  record.detail.field = ValidText(record.detail.field);
                  return ApplyAction(job, JobAction::kFail, clock_(), record.message, &record);
                })
      .status();
}

absl::Status Leases::Stopped(const Lease& lease) {
  return Update(lease,
                [&](JobTransaction& job) {
                  return ApplyAction(job, JobAction::kStop, clock_(), "cancelled on request");
                })
      .status();
}

absl::Status Leases::GiveBack(const Lease& lease, int64_t ran_ms, std::string_view why) {
  return Update(lease,
                [&](JobTransaction& job) {
                  job.job.run_ms = lease.job.run_ms + ran_ms;
                  return Return(job, why);
                })
      .status();
}

absl::Status Leases::NoteUnreferencedBlobs(const Lease& lease) {
  const absl::Status status = NoteUnreferencedBlobsOf(*store_, lease.job.id);
  return absl::IsNotFound(status) ? absl::OkStatus() : status;  // a deleted job's blobs are swept
}

absl::Status Leases::WorkerDied(std::string_view owner, std::string_view why) {
  return EndLeasesOf(owner, [&](JobTransaction& job) {
    return Abandon(job, absl::StrCat("its worker died: ", std::string(why)));
  });
}

absl::Status Leases::WorkerStopped(std::string_view owner) {
  return EndLeasesOf(owner, [&](JobTransaction& job) { return Return(job, kShutDown); });
}

absl::Status Leases::EndLeasesOf(std::string_view owner, const JobStore::Change& end) {
  LITAGS_ASSIGN_OR_RETURN(const std::vector<std::string> ids, store_->LeasedTo(owner));
  for (const std::string& id : ids) {
    const auto change = [&](JobTransaction& job) -> absl::Status {
      if (job.job.state != JobState::kRunning || job.job.lease_owner != owner) {
        return absl::OkStatus();  // another one noticed first
      }
      return end(job);
    };
    LITAGS_RETURN_IF_ERROR(store_->Update(id, change).status());
  }
  return store_->RemoveWorker(owner);
}

absl::Status Leases::Return(JobTransaction& job, std::string_view why) {
  if (job.job.cancel_requested) return Abandon(job, "");
  --job.job.attempt;
  return ApplyAction(job, JobAction::kRequeue, clock_(), why);
}

absl::Status Leases::Abandon(JobTransaction& job, std::string_view why) {
  if (job.job.cancel_requested) {
    return ApplyAction(job, JobAction::kStop, clock_(), "cancelled on request");
  }
  if (job.job.attempt >= options_.max_attempts) {
    const JobError error{
        absl::StatusCode::kAborted,
        absl::StrCat(std::string(why), ", at the last of ", options_.max_attempts,
                     " attempts since it was started or resumed; if memory ran out, set "
                     "max_image_side or max_gaussians lower, "
                     "else see the server's log; ResumeJob tries again from the last checkpoint"),
        {"WORKER_LOST", ""}};
    return ApplyAction(job, JobAction::kFail, clock_(), error.message, &error);
  }
  return ApplyAction(job, JobAction::kRequeue, clock_(),
                     absl::StrCat(std::string(why), "; back in the queue after attempt ",
                                  job.job.attempt, " of ", options_.max_attempts));
}

}  // namespace litags
