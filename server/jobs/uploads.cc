#include "server/jobs/uploads.h"

#include <unistd.h>

#include <algorithm>
#include <utility>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "server/jobs/client_job_store.h"
#include "server/jobs/codec.h"
#include "server/jobs/state_machine.h"
#include "server/jobs/sweep_mark.h"
#include "server/jobs/transition.h"
#include "server/store/digest.h"

namespace litags {
namespace {

// Signs of life are written down when the expiry would move by this part of its distance.
constexpr double kTouchFraction = 0.1;

// Each change waits for the disk once. Others wait meanwhile.
constexpr size_t kRowsPerChange = 200;

bool SameName(const FileRecord& a, const FileRecord& b) {
  return a.role == b.role && a.name == b.name;
}

bool IsIn(const std::vector<FileRecord>& files, const FileRecord& file) {
  return std::any_of(files.begin(), files.end(), [&](const FileRecord& f) {
    return SameName(f, file) && f.sha256 == file.sha256;
  });
}

// Notes that the job, which has `old` still, will have it no more under its name.
absl::Status NoteReplaced(JobTransaction& job, const FileRecord& old) {
  LITAGS_ASSIGN_OR_RETURN(const FileTally tally, job.Tally(old.sha256));
  if (tally.same_bytes <= 1) job.job.unreferenced_bytes += old.size_bytes;
  return absl::OkStatus();
}

// The files of a job outside of transactions.
struct StoredRows {
  ClientStore* store;
  std::string_view id;
  absl::StatusOr<std::vector<FileRecord>> Files() const { return store->Files(id); }
  absl::StatusOr<std::optional<FileRecord>> File(FileRole role, std::string_view name) const {
    return store->File(id, role, name);
  }
  absl::StatusOr<FileTally> Tally(std::string_view sha256) const {
    return store->Tally(id, sha256);
  }
};

// The key of a file on its way: another one for the same bytes under another name.
std::string PartialKey(const FileRecord& file) {
  return Sha256::Hex(absl::StrCat(static_cast<int>(file.role), "/", file.sha256, "/", file.name));
}

// That the job takes files, or will: see Reopen().
absl::Status CheckTakesFiles(const JobRecord& job) {
  LITAGS_RETURN_IF_ERROR(NextState(job.state, JobAction::kUpload).status());
  if (job.state != JobState::kFailed || job.report.empty()) return absl::OkStatus();
  return MakeError(absl::StatusCode::kFailedPrecondition, "JOB_NOT_UPLOADING", "name",
                   "the job has a finished scene, which is of the files that it has; create "
                   "a new job for others");
}

}  // namespace

template <typename Rows>
absl::StatusOr<Uploads::Present> Uploads::LookUp(Rows rows, const FileRecord& file) {
  Present present;
  LITAGS_ASSIGN_OR_RETURN(present.named, rows.File(file.role, file.name));
  LITAGS_ASSIGN_OR_RETURN(present.tally, rows.Tally(file.sha256));
  if (GivesCameras(file.role)) {
    LITAGS_ASSIGN_OR_RETURN(present.cameras, rows.Files());
  }
  return present;
}

double Uploads::check_seconds() const { return kTouchFraction * limits().keep_seconds; }

absl::Status Uploads::Check(std::string_view id) {
  LITAGS_ASSIGN_OR_RETURN(const JobRecord job, store_->Get(id));
  LITAGS_RETURN_IF_ERROR(CheckTakesFiles(job));
  if (job.state != JobState::kUploading) return absl::OkStatus();  // expires as it did
  const int64_t step = static_cast<int64_t>(1000 * check_seconds());
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

absl::Status Uploads::ReopenIn(JobTransaction& job, std::string* kept) const {
  kept->clear();
  if (job.job.state != JobState::kFailed) return absl::OkStatus();
  LITAGS_RETURN_IF_ERROR(CheckTakesFiles(job.job));
  if (IsBeingSwept(job.job, clock_())) {
    return MakeError(absl::StatusCode::kUnavailable, "JOB_BUSY", "name",
                     "what the job's earlier uploads left is being removed; nothing was changed, "
                     "try again in a moment");
  }
  *kept = job.job.kept;
  LITAGS_RETURN_IF_ERROR(
      ApplyAction(job, JobAction::kUpload, clock_(), "takes other files, and starts afresh"));
  job.job.expire_time_ms = Expiry();
  return absl::OkStatus();
}

absl::Status Uploads::Reopen(std::string_view id) {
  LITAGS_ASSIGN_OR_RETURN(const JobRecord seen, store_->Get(id));
  if (seen.state != JobState::kFailed) return absl::OkStatus();
  std::string kept;
  const auto change = [&](JobTransaction& job) { return ReopenIn(job, &kept); };
  LITAGS_RETURN_IF_ERROR(store_->Update(id, change).status());
  RemoveKept(id, kept);
  return absl::OkStatus();
}

void Uploads::RemoveKept(std::string_view id, const std::string& kept) {
  if (kept.empty()) return;
  const auto files = Decode<KeptFiles>(kept);
  if (!files.ok()) return;
  for (const auto& [name, file] : *files) {
    // A store that is away is waited for once. A sweep tries again, after the upload.
    if (!blobs_->Remove(BlobKey(id, file.blob)).ok()) return;
  }
}

absl::StatusOr<bool> Uploads::IsStored(std::string_view id, const FileRecord& file) {
  LITAGS_ASSIGN_OR_RETURN(const auto stored, store_->File(id, file.role, file.name));
  return stored && stored->sha256 == file.sha256;
}

absl::StatusOr<std::vector<FileStatus>> Uploads::Query(std::string_view id,
                                                       const std::vector<FileRecord>& files) {
  LITAGS_RETURN_IF_ERROR(Check(id));
  // One row for one file, as the page asks; for more, all at once.
  std::vector<FileRecord> stored;
  if (files.size() == 1) {
    LITAGS_ASSIGN_OR_RETURN(auto row, store_->File(id, files[0].role, files[0].name));
    if (row) stored.push_back(*std::move(row));
  } else {
    LITAGS_ASSIGN_OR_RETURN(stored, store_->Files(id));
  }
  std::vector<FileStatus> result;
  BlobsOf blobs_of;
  for (const FileRecord& file : files) {
    FileStatus& status = result.emplace_back();
    if (IsIn(stored, file)) {
      status = {true, file.size_bytes};
      continue;
    }
    LITAGS_ASSIGN_OR_RETURN(const auto same, FindBytes(id, file));
    if (same) {
      LITAGS_ASSIGN_OR_RETURN(const bool there, HasBlob(same->job_id, file.sha256, &blobs_of));
      if (there) {
        status.offset = file.size_bytes;
        continue;
      }
    }
    LITAGS_ASSIGN_OR_RETURN(const int64_t there,
                            partials().Size(id, PartialKey(file), file.size_bytes));
    status.offset = std::min(there, file.size_bytes);
  }
  return result;
}

absl::Status Uploads::CheckRoom(const JobRecord& job, const Present& present,
                                const FileRecord& file, const PartialFiles::Usage& coming) const {
  const int64_t count = 1 + coming.files + present.tally.files - (present.named ? 1 : 0);
  int64_t bytes = file.size_bytes + coming.bytes + job.unreferenced_bytes + job.bytes;
  if (present.Has(file)) bytes -= present.named->size_bytes;
  for (const FileRecord& f : present.cameras) {
    if (SameName(f, file) || !GivesCameras(f.role)) continue;
    if (f.role != file.role || file.role == FileRole::kCameras) {
      return InvalidInput("CAMERAS_TWICE", absl::StrCat("cameras[", file.name, "]"),
                          absl::StrCat("the job has the cameras of ", f.name,
                                       " already; a job takes one "
                                       "transforms.json or one COLMAP model"));
    }
  }
  if (count > limits().max_files) {
    return MakeError(absl::StatusCode::kResourceExhausted, "TOO_MANY_FILES", "images",
                     absl::StrCat("jobs/", job.id, " would have ", count, " files; a job may have ",
                                  limits().max_files, "; upload fewer or split the capture"));
  }
  if (bytes > limits().max_job_bytes) {
    return MakeError(absl::StatusCode::kResourceExhausted, "JOB_TOO_LARGE", "images",
                     absl::StrCat("jobs/", job.id, " would have ", bytes,
                                  " bytes of files, replaced ones included; a job may have ",
                                  limits().max_job_bytes, "; upload fewer or smaller photos"));
  }
  return absl::OkStatus();
}

// Whether the owner of the job may have this file, too.
absl::Status Uploads::CheckQuota(const JobRecord& job, const FileRecord& file) const {
  if (max_owner_bytes_ == 0) return absl::OkStatus();
  LITAGS_ASSIGN_OR_RETURN(const OwnerUsage usage, store_->UsageOf(job.owner));
  int64_t bytes = usage.bytes + file.size_bytes;
  LITAGS_ASSIGN_OR_RETURN(const std::vector<std::string> uploading, store_->Uploading(job.owner));
  for (const std::string& id : uploading) {
    bytes += area_->partials.UsageOf(id, id == job.id ? PartialKey(file) : "").bytes;
  }
  return CheckByteQuota(bytes, max_owner_bytes_);
}

absl::StatusOr<std::unique_ptr<PartialFile>> Uploads::Open(std::string_view id,
                                                           const FileRecord& file, int64_t offset) {
  LITAGS_RETURN_IF_ERROR(Check(id));
  LITAGS_ASSIGN_OR_RETURN(const Present present, LookUp(StoredRows{store_, id}, file));
  const std::string key = PartialKey(file);
  const auto announced = [&]() -> absl::StatusOr<std::shared_ptr<PartialSlot>> {
    LITAGS_ASSIGN_OR_RETURN(const JobRecord job, store_->Get(id));
    auto& mutexes = area_->announce_mutexes;
    const std::lock_guard lock(mutexes[std::hash<std::string>()(job.owner) % mutexes.size()]);
    // What is there of the file itself counts with it.
    LITAGS_RETURN_IF_ERROR(CheckRoom(job, present, file, partials().UsageOf(id, key)));
    LITAGS_RETURN_IF_ERROR(CheckQuota(job, file));
    return partials().Announce(id, key, file.size_bytes);
  }();
  LITAGS_RETURN_IF_ERROR(announced.status());
  LITAGS_ASSIGN_OR_RETURN(auto partial, partials().Open(id, key, file.size_bytes, offset));
  LITAGS_RETURN_IF_ERROR(Reopen(id));  // not for a bad offset: it costs the checkpoints
  // A job that was cancelled or deleted meanwhile has no files on their way.
  if (const absl::Status status = Check(id); !status.ok()) {
    partials().RemoveJob(id).IgnoreError();
    return status;
  }
  return partial;
}

// Another server may be about to name bytes that no row names now. So nothing is removed while the
// job takes files; what was replaced counts as the client's until Jobs::RemoveUnreferencedBlobs()
// removes it.
absl::Status Uploads::PutRow(std::string_view id, const FileRecord& file, int64_t returning) {
  return PutRows(id, absl::MakeConstSpan(&file, 1), returning);
}

absl::Status Uploads::PutRows(std::string_view id, absl::Span<const FileRecord> files,
                              int64_t returning) {
  const auto change = [&](JobTransaction& job) -> absl::Status {
    LITAGS_RETURN_IF_ERROR(NextState(job.job.state, JobAction::kUpload).status());
    if (job.job.state != JobState::kUploading) {
      return MakeError(absl::StatusCode::kFailedPrecondition, "JOB_NOT_UPLOADING", "name",
                       "the job was started, and has failed, while the file came; send it again");
    }
    job.job.expire_time_ms = Expiry();
    PartialFiles::Usage put;  // their rows are there, the job's own tells nothing of them
    for (const FileRecord& file : files) {
      LITAGS_ASSIGN_OR_RETURN(const Present present, LookUp<JobTransaction&>(job, file));
      int64_t& unreferenced = job.job.unreferenced_bytes;
      if (present.tally.same_bytes == 0) unreferenced -= std::min(unreferenced, returning);
      LITAGS_RETURN_IF_ERROR(CheckRoom(job.job, present, file, put));
      if (present.named && !present.Has(file)) {
        LITAGS_RETURN_IF_ERROR(NoteReplaced(job, *present.named));
      }
      put.bytes += file.size_bytes - (present.named ? present.named->size_bytes : 0);
      LITAGS_RETURN_IF_ERROR(job.PutFile(file));
    }
    return absl::OkStatus();
  };
  const absl::Status status = store_->Update(id, change).status();
  if (!status.ok()) NoteUnreferencedBlobs(id);
  return status;
}

// A file was stored that the job does not have. At worst it goes with the job.
void Uploads::NoteUnreferencedBlobs(std::string_view id) {
  if (!absl::IsNotFound(NoteUnreferencedBlobsOf(*store_, id))) return;
  // Of a deleted job. A sweep tries again.
  blobs_->RemoveFolder(absl::StrCat("jobs/", std::string(id))).IgnoreError();
}

absl::StatusOr<std::optional<JobFile>> Uploads::FindBytes(std::string_view id,
                                                          const FileRecord& file) {
  if (file.role == FileRole::kArchive) return std::nullopt;  // unpacked, not kept
  auto found = store_->FindFile(id, file.role, file.sha256);
  if (!found.ok() || !*found) return found;
  const FileRecord& same = (*found)->file;
  // The name of a COLMAP model's file tells as what it was read.
  const bool read_alike = file.role != FileRole::kColmap || same.name == file.name;
  if (same.size_bytes == file.size_bytes && read_alike) return found;
  return std::nullopt;
}

absl::StatusOr<bool> Uploads::HasBlob(const std::string& id, const std::string& sha256,
                                      BlobsOf* blobs_of) const {
  const auto [blobs, is_new] = blobs_of->try_emplace(id);
  if (is_new) {
    LITAGS_ASSIGN_OR_RETURN(const auto names, blobs_->List(absl::StrCat("jobs/", id)));
    blobs->second.insert(names.begin(), names.end());
  }
  return blobs->second.contains(sha256);
}

// Before bytes are stored: those that are refused only then are of no job, and count for nobody.
absl::StatusOr<int64_t> Uploads::CheckAdd(std::string_view id, const FileRecord& file) {
  LITAGS_RETURN_IF_ERROR(Check(id));
  LITAGS_ASSIGN_OR_RETURN(JobRecord job, store_->Get(id));
  LITAGS_ASSIGN_OR_RETURN(const Present present, LookUp(StoredRows{store_, id}, file));
  if (present.Has(file)) return 0;
  int64_t returning = 0;
  if (job.unreferenced_bytes > 0 && present.tally.same_bytes == 0) {
    LITAGS_ASSIGN_OR_RETURN(const bool there, blobs_->Has(BlobKey(job.id, file.sha256)));
    if (there) returning = std::min(file.size_bytes, job.unreferenced_bytes);
  }
  job.unreferenced_bytes -= returning;
  LITAGS_RETURN_IF_ERROR(CheckRoom(job, present, file, {}));
  if (max_owner_bytes_ > 0) {
    LITAGS_ASSIGN_OR_RETURN(const OwnerUsage usage, store_->UsageOf(job.owner));
    LITAGS_RETURN_IF_ERROR(
        CheckByteQuota(usage.bytes - returning + file.size_bytes, max_owner_bytes_));
  }
  LITAGS_RETURN_IF_ERROR(Reopen(id));
  return returning;
}

absl::Status Uploads::StoreBytes(std::string_view id, const FileRecord& file,
                                 const std::string& path) {
  const std::string key = BlobKey(id, file.sha256);
  LITAGS_ASSIGN_OR_RETURN(const auto same, FindBytes(id, file));
  const std::string same_key = same ? BlobKey(same->job_id, file.sha256) : "";
  const absl::Status linked = same ? blobs_->Link(same_key, key) : absl::NotFoundError("");
  if (linked.ok()) {
    unlink(path.c_str());
    return absl::OkStatus();
  }
  LITAGS_RETURN_IF_ERROR(blobs_->PutFile(key, path));
  if (!same || !absl::IsNotFound(linked)) return absl::OkStatus();
  // That job lost the bytes, unless it was deleted just now. Else each later job would look for
  // them there.
  if (store_->Get(same->job_id).ok()) blobs_->Link(key, same_key).IgnoreError();
  return absl::OkStatus();
}

absl::Status Uploads::Add(std::string_view id, const FileRecord& file, const std::string& path) {
  LITAGS_ASSIGN_OR_RETURN(const int64_t returning, CheckAdd(id, file));
  LITAGS_RETURN_IF_ERROR(StoreBytes(id, file, path));
  return PutRow(id, file, returning);
}

absl::StatusOr<bool> Uploads::Adopt(std::string_view id, const FileRecord& file) {
  LITAGS_ASSIGN_OR_RETURN(const auto same, FindBytes(id, file));
  if (!same) return false;
  LITAGS_ASSIGN_OR_RETURN(const int64_t returning, CheckAdd(id, file));
  const absl::Status linked =
      blobs_->Link(BlobKey(same->job_id, file.sha256), BlobKey(id, file.sha256));
  if (absl::IsNotFound(linked)) return false;  // that job lost them, or was deleted just now
  LITAGS_RETURN_IF_ERROR(linked);
  FileRecord mine = same->file;
  mine.name = file.name;
  LITAGS_RETURN_IF_ERROR(PutRow(id, mine, returning));
  return true;
}

absl::Status Uploads::AdoptFrom(std::string_view source, std::string_view id,
                                absl::Span<const FileRecord> files, const CancelToken& cancel) {
  LITAGS_RETURN_IF_ERROR(Check(id));
  if (max_owner_bytes_ > 0) {
    LITAGS_ASSIGN_OR_RETURN(const JobRecord job, store_->Get(id));
    LITAGS_ASSIGN_OR_RETURN(const OwnerUsage usage, store_->UsageOf(job.owner));
    int64_t bytes = usage.bytes;
    for (const FileRecord& file : files) bytes += file.size_bytes;
    LITAGS_RETURN_IF_ERROR(CheckByteQuota(bytes, max_owner_bytes_));
  }
  absl::Status status;
  std::vector<FileRecord> linked;
  const auto put = [&] { return PutRows(id, std::exchange(linked, {}), 0); };
  for (const FileRecord& file : files) {
    status = cancel.Check();
    if (status.ok() && file.role != FileRole::kArchive) {
      status = blobs_->Link(BlobKey(source, file.sha256), BlobKey(id, file.sha256));
    }
    if (absl::IsNotFound(status)) {
      status = MakeError(absl::StatusCode::kAborted, "CLONED_FILE_GONE", "name",
                         absl::StrCat("\"", file.name, "\" of jobs/", std::string(source),
                                      " was deleted while it was cloned; delete jobs/",
                                      std::string(id), ", or upload what it lacks"));
    }
    if (!status.ok()) break;
    linked.push_back(file);
    if (linked.size() == kRowsPerChange) LITAGS_RETURN_IF_ERROR(put());
  }
  if (!linked.empty()) LITAGS_RETURN_IF_ERROR(put());
  return status;
}

absl::StatusOr<bool> Uploads::Remove(std::string_view id, FileRole role, std::string_view name) {
  LITAGS_RETURN_IF_ERROR(Check(id));
  bool removed = false;
  std::string kept;
  const auto change = [&](JobTransaction& job) -> absl::Status {
    LITAGS_RETURN_IF_ERROR(NextState(job.job.state, JobAction::kUpload).status());
    LITAGS_ASSIGN_OR_RETURN(const auto file, job.File(role, name));
    removed = file.has_value();
    if (!removed) return absl::OkStatus();  // a FAILED job keeps its checkpoints
    LITAGS_RETURN_IF_ERROR(ReopenIn(job, &kept));
    LITAGS_RETURN_IF_ERROR(NoteReplaced(job, *file));
    job.job.has_unreferenced_blobs = true;
    job.job.expire_time_ms = Expiry();
    LITAGS_RETURN_IF_ERROR(job.RemoveFile(role, name));
    // The file may be an archive's: sent again, that is unpacked again, and brings it back.
    return job.RemoveFiles(FileRole::kArchive);
  };
  LITAGS_RETURN_IF_ERROR(store_->Update(id, change).status());
  RemoveKept(id, kept);
  return removed;
}

absl::Status Uploads::NoteArchive(std::string_view id, FileRecord archive) {
  archive.size_bytes = 0;
  return PutRow(id, archive, 0);
}

absl::Status Uploads::RemovePartialsOf(std::string_view id) {
  absl::Status status = partials().RemoveJob(id);
  status.Update(partials().chunks().RemoveJob(id));
  return status;
}

absl::Status Uploads::RemoveAllOf(std::string_view id) {
  const absl::Status status = RemovePartialsOf(id);
  if (absl::IsUnavailable(status)) return status;  // and would be waited for again
  const absl::Status removed = blobs_->RemoveFolder(absl::StrCat("jobs/", std::string(id)));
  return status.ok() ? removed : status;
}

}  // namespace litags
