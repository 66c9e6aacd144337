// What a service that runs for years must throw away: Jobs::Sweep().
#include <spdlog/spdlog.h>

#include <algorithm>
#include <map>
#include <set>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "server/jobs/codec.h"
#include "server/jobs/jobs.h"
#include "server/jobs/state_machine.h"
#include "server/store/digest.h"

namespace litags {
namespace {

constexpr int kJobsPerSweep = 1000;
constexpr int kEventsPerRead = 1000;

// As RandomHex(8) makes them. Other names in our folders are not ours.
bool IsJobId(const std::string& name) {
  return name.size() == 16 && name.find_first_not_of("0123456789abcdef") == std::string::npos;
}

bool IsNumber(const std::string& name) {
  return !name.empty() && name.find_first_not_of("0123456789") == std::string::npos;
}

}  // namespace

absl::Status Jobs::RemoveFolders(std::string_view id) {
  absl::Status status = uploads_.partials().RemoveJob(id);
  status.Update(blobs_->RemoveFolder(absl::StrCat("jobs/", std::string(id))));
  return status;
}

absl::StatusOr<bool> Jobs::RemoveExpired(std::string_view id) {
  if (uploads_.partials().InUse(id)) return false;
  bool removed = false;
  const auto change = [&](JobTransaction& job) -> absl::Status {
    // A sign of life may have come since the list was made.
    removed = job.job.expire_time_ms > 0 && job.job.expire_time_ms <= clock_() &&
              NextState(job.job.state, JobAction::kRemove).ok();
    return removed ? job.Remove() : absl::OkStatus();
  };
  const absl::Status status = store_->Update(id, change).status();
  if (absl::IsNotFound(status)) return false;  // deleted meanwhile
  LITAGS_RETURN_IF_ERROR(status);
  if (removed) LITAGS_RETURN_IF_ERROR(RemoveFolders(id));
  return removed;
}

// Names of the folders of jobs, in the blob store and of files on their way.
absl::StatusOr<std::set<std::string>> Jobs::JobFolders() {
  LITAGS_ASSIGN_OR_RETURN(const auto partials, ListFolder(data_.uploads()));
  LITAGS_ASSIGN_OR_RETURN(const auto blobs, blobs_->List("jobs"));
  LITAGS_ASSIGN_OR_RETURN(const auto chunks, uploads_.partials().chunks().Jobs());
  std::set<std::string> names(blobs.begin(), blobs.end());
  names.insert(chunks.begin(), chunks.end());
  for (const FolderEntry& entry : partials) names.insert(entry.name);
  std::erase_if(names, [](const std::string& name) { return !IsJobId(name); });
  return names;
}

// A row is there before its folders are: a folder without one was left behind by a crash, or its
// row was lost, as with the wrong job store or an old copy of it. The delay, from the moment at
// which the row was first missed, is the operator's time to bring the row back.
absl::Status Jobs::RemoveOrphans() {
  LITAGS_ASSIGN_OR_RETURN(const auto folders, JobFolders());
  const int64_t now_ms = clock_();
  std::map<std::string, int64_t> missed;
  bool is_news = false;
  for (const std::string& id : folders) {
    const absl::Status row = store_->Get(id).status();
    if (row.ok()) continue;
    if (!absl::IsNotFound(row)) return row;
    const auto before = missed_since_ms_.find(id);
    const bool is_new = before == missed_since_ms_.end();
    missed[id] = is_new ? now_ms : before->second;
    is_news |= is_new;
  }
  const double keep_seconds = uploads_.limits().keep_seconds;
  if (is_news) {
    spdlog::warn(
        "{} jobs that have files, jobs/{} among them, are not in the job store: their files are "
        "removed after {:.1f} hours; if this is the wrong job store, or an old copy, put the right "
        "one back before",
        missed.size(), missed.begin()->first, keep_seconds / 3600);
  }
  missed_since_ms_ = std::move(missed);
  for (const auto& [id, since_ms] : missed_since_ms_) {
    if (static_cast<double>(now_ms - since_ms) < 1000 * keep_seconds) continue;
    LITAGS_RETURN_IF_ERROR(RemoveOrphan(id));
  }
  return absl::OkStatus();
}

absl::Status Jobs::RemoveOrphan(const std::string& id) {
  LITAGS_ASSIGN_OR_RETURN(const double blob_seconds,
                          blobs_->QuietSeconds(absl::StrCat("jobs/", id)));
  LITAGS_ASSIGN_OR_RETURN(const double chunk_seconds,
                          uploads_.partials().chunks().QuietSeconds(id));
  if (std::min(blob_seconds, chunk_seconds) < uploads_.limits().keep_seconds) {
    return absl::OkStatus();
  }
  LITAGS_RETURN_IF_ERROR(RemoveFolders(id));
  spdlog::warn("job={} is not in the job store; its files were removed", id);
  return absl::OkStatus();
}

// What was on its way into jobs that do not take files any more.
absl::Status Jobs::RemoveEndedUploads() {
  LITAGS_ASSIGN_OR_RETURN(const auto partials, ListFolder(data_.uploads()));
  LITAGS_ASSIGN_OR_RETURN(const auto chunks, uploads_.partials().chunks().Jobs());
  std::set<std::string> uploading(chunks.begin(), chunks.end());
  for (const FolderEntry& entry : partials) uploading.insert(entry.name);
  for (const std::string& id : uploading) {
    if (!IsJobId(id)) continue;
    const auto job = store_->Get(id);
    if (job.ok() && job->state != JobState::kUploading) {
      LITAGS_RETURN_IF_ERROR(uploads_.partials().RemoveJob(id));
    }
  }
  return absl::OkStatus();
}

// Of files that were replaced or refused while the job took files, and of a worker that died or
// lost its lease, there may be blobs that no row names. While a job takes no files and does not
// run, nobody can come to name such a blob, since no lease stores under another one's keys: what is
// not named now is of no use to anybody.
absl::Status Jobs::RemoveUnreferencedBlobs(const std::string& id) {
  const std::string folder = absl::StrCat("jobs/", id);
  LITAGS_ASSIGN_OR_RETURN(const auto names, blobs_->List(folder));
  std::map<std::string, std::vector<std::string>> of_leases;
  std::vector<std::string> uploaded;
  for (const std::string& name : names) {
    if (IsDigest(name)) {
      uploaded.push_back(name);
    } else if (IsNumber(name)) {
      LITAGS_ASSIGN_OR_RETURN(of_leases[name], blobs_->List(absl::StrCat(folder, "/", name)));
    }
  }
  // After the list: a job that does not run now has stored nothing since.
  LITAGS_ASSIGN_OR_RETURN(const JobRecord job, store_->Get(id));
  if (job.state == JobState::kUploading || job.state == JobState::kQueued ||
      job.state == JobState::kRunning) {
    return absl::OkStatus();
  }
  LITAGS_ASSIGN_OR_RETURN(const std::set<std::string> named, BlobsNamedBy(job));
  LITAGS_RETURN_IF_ERROR(RemoveUnreferencedUploads(id, uploaded));
  for (const auto& [lease, blobs] : of_leases) {
    // The copy is for clang 14, which takes no structured binding by reference.
    const auto is_named = [&named, lease = lease](const std::string& sha256) {
      return named.contains(absl::StrCat(lease, "/", sha256));
    };
    if (std::none_of(blobs.begin(), blobs.end(), is_named)) {
      LITAGS_RETURN_IF_ERROR(blobs_->RemoveFolder(absl::StrCat(folder, "/", lease)));
      continue;
    }
    for (const std::string& sha256 : blobs) {
      if (is_named(sha256)) continue;
      LITAGS_RETURN_IF_ERROR(blobs_->Remove(absl::StrCat(folder, "/", lease, "/", sha256)));
    }
  }
  return store_
      ->Update(id,
               [&](JobTransaction& now) {
                 if (now.job.last_event != job.last_event) return absl::OkStatus();
                 now.job.has_unreferenced_blobs = false;
                 now.job.unreferenced_bytes = 0;
                 return absl::OkStatus();
               })
      .status();
}

// A FAILED job may take files again, which may have the digest of an old one: whoever adds them
// changes the state first, and so waits for this transaction.
absl::Status Jobs::RemoveUnreferencedUploads(const std::string& id,
                                             const std::vector<std::string>& digests) {
  const auto change = [&](JobTransaction& job) -> absl::Status {
    if (!IsTerminal(job.job.state)) return absl::OkStatus();
    std::set<std::string> named;
    LITAGS_ASSIGN_OR_RETURN(const auto files, job.Files());
    for (const FileRecord& file : files) named.insert(file.sha256);
    for (const std::string& sha256 : digests) {
      if (named.contains(sha256)) continue;
      LITAGS_RETURN_IF_ERROR(blobs_->Remove(BlobKey(id, sha256)));
    }
    return absl::OkStatus();
  };
  return store_->Update(id, change).status();
}

absl::StatusOr<std::set<std::string>> Jobs::BlobsNamedBy(const JobRecord& job) {
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

absl::StatusOr<std::vector<std::string>> Jobs::Sweep() {
  const std::lock_guard lock(sweep_mutex_);
  LITAGS_ASSIGN_OR_RETURN(const auto ids, store_->Expired(clock_(), kJobsPerSweep));
  std::vector<std::string> removed;
  for (const std::string& id : ids) {
    LITAGS_ASSIGN_OR_RETURN(const bool gone, RemoveExpired(id));
    if (gone) removed.push_back(id);
  }
  LITAGS_RETURN_IF_ERROR(RemoveOrphans());
  LITAGS_RETURN_IF_ERROR(RemoveEndedUploads());
  LITAGS_ASSIGN_OR_RETURN(const auto jobs_with_unreferenced,
                          store_->JobsWithUnreferencedBlobs(kJobsPerSweep));
  for (const std::string& id : jobs_with_unreferenced) {
    const absl::Status status = RemoveUnreferencedBlobs(id);
    if (!absl::IsNotFound(status)) LITAGS_RETURN_IF_ERROR(status);  // else deleted meanwhile
  }
  data_.EmptyTmp(uploads_.limits().keep_seconds);
  blobs_->RemoveTemporary();
  return removed;
}

}  // namespace litags
