#include "server/jobs/uploads.h"

#include <unistd.h>

#include <algorithm>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "server/jobs/client_job_store.h"
#include "server/jobs/state_machine.h"
#include "server/store/digest.h"

namespace litags {
namespace {

// Signs of life are written down when the expiry would move by this part of its distance.
constexpr double kTouchFraction = 0.1;

bool SameName(const FileRecord& a, const FileRecord& b) {
  return a.role == b.role && a.name == b.name;
}

bool IsIn(const std::vector<FileRecord>& files, const FileRecord& file) {
  return std::any_of(files.begin(), files.end(), [&](const FileRecord& f) {
    return SameName(f, file) && f.sha256 == file.sha256;
  });
}

bool GivesCameras(const FileRecord& file) {
  return file.role == FileRole::kCameras || file.role == FileRole::kColmap;
}

// The key of a file on its way: another one for the same bytes under another name.
std::string PartialKey(const FileRecord& file) {
  return Sha256::Hex(absl::StrCat(static_cast<int>(file.role), "/", file.sha256, "/", file.name));
}

}  // namespace

absl::Status Uploads::Check(std::string_view id) {
  LITAGS_ASSIGN_OR_RETURN(const JobRecord job, store_->Get(id));
  LITAGS_RETURN_IF_ERROR(NextState(job.state, JobAction::kUpload).status());
  const int64_t step = static_cast<int64_t>(1000 * kTouchFraction * limits().keep_seconds);
  if (Expiry() - job.expire_time_ms < step) return absl::OkStatus();
  return store_
      ->Update(
          id,
          [&](JobTransaction& transaction) -> absl::Status {
            LITAGS_RETURN_IF_ERROR(NextState(transaction.job.state, JobAction::kUpload).status());
            transaction.job.expire_time_ms = Expiry();
            return absl::OkStatus();
          })
      .status();
}

absl::StatusOr<bool> Uploads::IsStored(std::string_view id, const FileRecord& file) {
  LITAGS_ASSIGN_OR_RETURN(const std::vector<FileRecord> files, store_->Files(id));
  return IsIn(files, file);
}

absl::StatusOr<std::vector<FileStatus>> Uploads::Query(std::string_view id,
                                                       const std::vector<FileRecord>& files) {
  LITAGS_RETURN_IF_ERROR(Check(id));
  LITAGS_ASSIGN_OR_RETURN(const std::vector<FileRecord> stored, store_->Files(id));
  std::vector<FileStatus> result;
  for (const FileRecord& file : files) {
    FileStatus& status = result.emplace_back();
    if (IsIn(stored, file)) {
      status = {true, file.size_bytes};
      continue;
    }
    LITAGS_ASSIGN_OR_RETURN(const auto same, FindBytes(id, file));
    if (same) {
      status.offset = file.size_bytes;
      continue;
    }
    LITAGS_ASSIGN_OR_RETURN(const int64_t there,
                            partials().Size(id, PartialKey(file), file.size_bytes));
    status.offset = std::min(there, file.size_bytes);
  }
  return result;
}

absl::Status Uploads::CheckRoom(std::string_view id, const std::vector<FileRecord>& files,
                                const FileRecord& file, const PartialFiles::Usage& coming) const {
  int64_t count = 1 + coming.files, bytes = file.size_bytes + coming.bytes;
  for (const FileRecord& f : files) {
    if (SameName(f, file)) continue;  // will be replaced
    ++count;
    bytes += f.size_bytes;
    if (GivesCameras(f) && GivesCameras(file) &&
        (f.role != file.role || file.role == FileRole::kCameras)) {
      return InvalidInput("CAMERAS_TWICE", absl::StrCat("cameras[", file.name, "]"),
                          absl::StrCat("the job has the cameras of ", f.name,
                                       " already; a job takes one "
                                       "transforms.json or one COLMAP model"));
    }
  }
  if (count > limits().max_files) {
    return MakeError(
        absl::StatusCode::kResourceExhausted, "TOO_MANY_FILES", "images",
        absl::StrCat("jobs/", std::string(id), " would have ", count, " files; a job may have ",
                     limits().max_files, "; upload fewer or split the capture"));
  }
  if (bytes > limits().max_job_bytes) {
    return MakeError(absl::StatusCode::kResourceExhausted, "JOB_TOO_LARGE", "images",
                     absl::StrCat("jobs/", std::string(id), " would have ", bytes,
                                  " bytes of files; a job may have ", limits().max_job_bytes,
                                  "; upload fewer or smaller photos"));
  }
  return absl::OkStatus();
}

// Whether the owner of the job may have this file, too.
absl::Status Uploads::CheckQuota(const JobRecord& job, const FileRecord& file) const {
  if (max_owner_bytes_ == 0) return absl::OkStatus();
  LITAGS_ASSIGN_OR_RETURN(const OwnerUsage usage, store_->UsageOf(job.owner));
  int64_t bytes = usage.bytes + file.size_bytes;
  for (const std::string& other_id : area_->partials.Jobs()) {
    const auto other = store_->Get(other_id);
    if (!other.ok() || other->owner != job.owner) continue;
    bytes += area_->partials.UsageOf(other_id, other_id == job.id ? PartialKey(file) : "").bytes;
  }
  return CheckByteQuota(bytes, max_owner_bytes_);
}

absl::StatusOr<std::unique_ptr<PartialFile>> Uploads::Open(std::string_view id,
                                                           const FileRecord& file, int64_t offset) {
  LITAGS_RETURN_IF_ERROR(Check(id));
  LITAGS_ASSIGN_OR_RETURN(const std::vector<FileRecord> files, store_->Files(id));
  const std::string key = PartialKey(file);
  const auto announced = [&]() -> absl::StatusOr<std::shared_ptr<PartialSlot>> {
    LITAGS_ASSIGN_OR_RETURN(const JobRecord job, store_->Get(id));
    auto& mutexes = area_->announce_mutexes;
    const std::lock_guard lock(mutexes[std::hash<std::string>()(job.owner) % mutexes.size()]);
    // What is there of the file itself counts with it.
    LITAGS_RETURN_IF_ERROR(CheckRoom(id, files, file, partials().UsageOf(id, key)));
    LITAGS_RETURN_IF_ERROR(CheckQuota(job, file));
    return partials().Announce(id, key, file.size_bytes);
  }();
  LITAGS_RETURN_IF_ERROR(announced.status());
  auto partial = partials().Open(id, key, file.size_bytes, offset);
  // A job that was cancelled or deleted meanwhile has no files on their way.
  if (const absl::Status status = Check(id); !status.ok()) {
    partials().RemoveJob(id).IgnoreError();
    return status;
  }
  return partial;
}

std::mutex& Uploads::AddMutex(std::string_view id) {
  return area_->add_mutexes[std::hash<std::string_view>()(id) % area_->add_mutexes.size()];
}

// Under AddMutex.
absl::Status Uploads::PutRow(std::string_view id, const FileRecord& file) {
  std::string replaced;
  const auto change = [&](JobTransaction& job) -> absl::Status {
    LITAGS_RETURN_IF_ERROR(NextState(job.job.state, JobAction::kUpload).status());
    LITAGS_ASSIGN_OR_RETURN(const std::vector<FileRecord> files, job.Files());
    LITAGS_RETURN_IF_ERROR(CheckRoom(id, files, file, {}));
    for (const FileRecord& f : files) {
      if (SameName(f, file)) replaced = f.sha256;
    }
    job.job.expire_time_ms = Expiry();
    return job.PutFile(file);
  };
  const absl::Status status = store_->Update(id, change).status();
  // What these leave behind goes with the job.
  if (!status.ok()) RemoveUnused(id, file.sha256).IgnoreError();
  if (status.ok() && !replaced.empty()) RemoveUnused(id, replaced).IgnoreError();
  return status;
}

absl::StatusOr<std::optional<JobFile>> Uploads::FindBytes(std::string_view id,
                                                          const FileRecord& file) {
  if (file.role == FileRole::kArchive) return std::nullopt;  // unpacked, not kept
  auto found = store_->FindFile(id, file.role, file.sha256);
  if (!found.ok() || !*found || (*found)->file.size_bytes == file.size_bytes) return found;
  return std::nullopt;
}

absl::Status Uploads::Add(std::string_view id, const FileRecord& file, const std::string& path) {
  LITAGS_RETURN_IF_ERROR(Check(id));
  const std::lock_guard lock(AddMutex(id));
  const std::string key = BlobKey(id, file.sha256);
  LITAGS_ASSIGN_OR_RETURN(const auto same, FindBytes(id, file));
  if (same && blobs_->Link(BlobKey(same->job_id, file.sha256), key).ok()) {
    unlink(path.c_str());
  } else {
    LITAGS_RETURN_IF_ERROR(blobs_->PutFile(key, path));
  }
  return PutRow(id, file);
}

absl::StatusOr<bool> Uploads::Adopt(std::string_view id, const FileRecord& file) {
  LITAGS_RETURN_IF_ERROR(Check(id));
  const std::lock_guard lock(AddMutex(id));
  LITAGS_ASSIGN_OR_RETURN(const auto same, FindBytes(id, file));
  if (!same) return false;
  const absl::Status linked =
      blobs_->Link(BlobKey(same->job_id, file.sha256), BlobKey(id, file.sha256));
  if (absl::IsNotFound(linked)) return false;  // that job was deleted just now
  LITAGS_RETURN_IF_ERROR(linked);
  FileRecord mine = same->file;
  mine.name = file.name;
  LITAGS_RETURN_IF_ERROR(PutRow(id, mine));
  return true;
}

absl::Status Uploads::NoteArchive(std::string_view id, FileRecord archive) {
  archive.size_bytes = 0;
  const std::lock_guard lock(AddMutex(id));
  return PutRow(id, archive);
}

absl::Status Uploads::RemoveUnused(std::string_view id, std::string_view sha256) {
  const auto files = store_->Files(id);
  if (absl::IsNotFound(files.status())) {
    return blobs_->RemoveFolder(absl::StrCat("jobs/", std::string(id)));
  }
  LITAGS_RETURN_IF_ERROR(files.status());
  const bool used = std::any_of(files->begin(), files->end(),
                                [&](const FileRecord& f) { return f.sha256 == sha256; });
  return used ? absl::OkStatus() : blobs_->Remove(BlobKey(id, sha256));
}

}  // namespace litags
