// What a service that runs for years must throw away: Jobs::Sweep().
#include <algorithm>
#include <filesystem>
#include <limits>
#include <map>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "server/jobs/jobs.h"
#include "server/jobs/state_machine.h"

namespace litags {
namespace {

namespace fs = std::filesystem;

constexpr int kExpiredPerSweep = 1000;

// As RandomHex(8) makes them. Other names in our folders are not ours.
bool IsJobId(const std::string& name) {
  return name.size() == 16 && name.find_first_not_of("0123456789abcdef") == std::string::npos;
}

}  // namespace

absl::Status Jobs::RemoveFolders(std::string_view id) {
  absl::Status status = uploads_.partials().RemoveJob(id);
  status.Update(blobs_->RemoveFolder(absl::StrCat("jobs/", std::string(id))));
  std::error_code error;
  fs::remove_all(data_.work(id), error);
  if (error) {
    status.Update(
        MakeError(absl::StatusCode::kInternal, "STORE_FAILED", "",
                  absl::StrCat("the job is deleted, but its work folder could not be removed: ",
                               error.message())));
  }
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

absl::Status Jobs::RemoveOrphans() {
  // How long the local folders of each job have been left alone.
  std::map<std::string, double> quiet;
  const auto note = [&](const std::string& name, double seconds) {
    if (!IsJobId(name)) return;
    const auto [it, added] = quiet.emplace(name, seconds);
    if (!added) it->second = std::min(it->second, seconds);
  };
  LITAGS_ASSIGN_OR_RETURN(const auto partials, ListFolder(data_.uploads()));
  LITAGS_ASSIGN_OR_RETURN(const auto works, ListFolder(data_.work()));
  LITAGS_ASSIGN_OR_RETURN(const auto blobs, blobs_->List("jobs"));
  for (const FolderEntry& entry : partials) note(entry.name, entry.quiet_seconds);
  for (const FolderEntry& entry : works) note(entry.name, entry.quiet_seconds);
  for (const std::string& name : blobs) note(name, std::numeric_limits<double>::infinity());
  for (const auto& [id, seconds] : quiet) {
    // A row is there before its folders are, so that a folder without a row was left behind by a
    // crash, or its row was lost: the delay is the operator's time to bring the row back.
    if (seconds < uploads_.limits().keep_seconds) continue;
    const absl::Status row = store_->Get(id).status();
    if (row.ok()) continue;
    if (!absl::IsNotFound(row)) return row;
    LITAGS_ASSIGN_OR_RETURN(const double blob_seconds,
                            blobs_->QuietSeconds(absl::StrCat("jobs/", id)));
    if (blob_seconds >= uploads_.limits().keep_seconds) {
      LITAGS_RETURN_IF_ERROR(RemoveFolders(id));
    }
  }
  for (const auto& entry : partials) {
    if (!IsJobId(entry.name)) continue;
    const auto job = store_->Get(entry.name);
    if (job.ok() && job->state != JobState::kUploading) {
      LITAGS_RETURN_IF_ERROR(uploads_.partials().RemoveJob(entry.name));
    }
  }
  return absl::OkStatus();
}

absl::StatusOr<std::vector<std::string>> Jobs::Sweep() {
  LITAGS_ASSIGN_OR_RETURN(const auto ids, store_->Expired(clock_(), kExpiredPerSweep));
  std::vector<std::string> removed;
  for (const std::string& id : ids) {
    LITAGS_ASSIGN_OR_RETURN(const bool gone, RemoveExpired(id));
    if (gone) removed.push_back(id);
  }
  LITAGS_RETURN_IF_ERROR(RemoveOrphans());
  data_.EmptyTmp(uploads_.limits().keep_seconds);
  return removed;
}

}  // namespace litags
