#include "server/jobs/jobs.h"

#include <algorithm>
#include <chrono>
#include <filesystem>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "server/jobs/codec.h"
#include "server/jobs/transition.h"
#include "server/store/digest.h"

namespace litags {
namespace {

// What a scene needs at least. The engine may still refuse photos that pass.
absl::Status CheckPhotos(const std::vector<FileRecord>& files) {
  const FileRecord* first = nullptr;
  const FileRecord* other = nullptr;  // of another size than the first
  int photos = 0;
  bool cameras = false;
  for (const FileRecord& file : files) {
    if (file.role == FileRole::kCameras) cameras = true;
    if (file.role != FileRole::kPhoto) continue;
    ++photos;
    if (!first) first = &file;
    if (!other && (file.width != first->width || file.height != first->height)) other = &file;
  }
  if (photos < 2) {
    return MakeError(absl::StatusCode::kFailedPrecondition, "TOO_FEW_PHOTOS", "images",
                     absl::StrCat("the job has ", photos, photos == 1 ? " photo" : " photos",
                                  "; a scene needs at least 2, and 20 or more look good"));
  }
  if (other && !cameras) {
    return MakeError(
        absl::StatusCode::kFailedPrecondition, "PHOTO_SIZES_DIFFER",
        absl::StrCat("images[", other->name, "]"),
        absl::StrCat(first->name, " has ", first->width, "x", first->height, " px and ",
                     other->name, " has ", other->width, "x", other->height,
                     " px; photos must share one size, unless cameras (transforms.json) are "
                     "uploaded with them"));
  }
  return absl::OkStatus();
}

}  // namespace

int64_t SystemClockMs() {
  using std::chrono::system_clock;
  return std::chrono::duration_cast<std::chrono::milliseconds>(
             system_clock::now().time_since_epoch())
      .count();
}

std::string BlobKey(std::string_view job_id, std::string_view sha256) {
  return absl::StrCat("jobs/", std::string(job_id), "/", std::string(sha256));
}

std::shared_ptr<Jobs> Jobs::For(ClientView view) const {
  struct Owned {
    ClientJobStore store;
    Jobs jobs;
    Owned(const Jobs& all, ClientView view)
        : store(all.store_, std::move(view)), jobs(&store, all.blobs_, all.data_, all.clock_) {}
  };
  auto owned = std::make_shared<Owned>(*this, std::move(view));
  return {owned, &owned->jobs};
}

absl::StatusOr<JobRecord> Jobs::Create(const std::string& request_id,
                                       const std::string& display_name,
                                       const ReconstructOptions& options) {
  const int64_t now_ms = clock_();
  JobRecord job;
  job.id = RandomHex(8);
  job.request_id = request_id;
  job.display_name = display_name;
  job.options = Encode(options);
  job.create_time_ms = now_ms;
  LITAGS_ASSIGN_OR_RETURN(JobRecord made, store_->Create(job, [&](JobTransaction& transaction) {
    return AddStateEvent(transaction, now_ms, "created");
  }));
  if (made.display_name != display_name || made.options != job.options) {
    return MakeError(absl::StatusCode::kAlreadyExists, "REQUEST_ID_REUSED", "request_id",
                     absl::StrCat("request_id \"", request_id, "\" made jobs/", made.id,
                                  " with another title or other options; use a new one"));
  }
  return made;
}

absl::Status Jobs::CheckUpload(std::string_view id) {
  LITAGS_ASSIGN_OR_RETURN(const JobRecord job, store_->Get(id));
  return NextState(job.state, JobAction::kUpload).status();
}

absl::StatusOr<bool> Jobs::HasFile(std::string_view id, const FileRecord& file) {
  LITAGS_ASSIGN_OR_RETURN(const std::vector<FileRecord> files, store_->Files(id));
  return std::any_of(files.begin(), files.end(), [&](const FileRecord& f) {
    return f.role == file.role && f.name == file.name && f.sha256 == file.sha256;
  });
}

absl::Status Jobs::AddFile(std::string_view id, const FileRecord& file, const std::string& path,
                           const UploadLimits& limits) {
  // Bytes first: a row never points at a blob that is not there. A blob without a row does no harm
  // and goes with its job.
  LITAGS_RETURN_IF_ERROR(CheckUpload(id));
  LITAGS_RETURN_IF_ERROR(blobs_->PutFile(BlobKey(id, file.sha256), path));
  const auto change = [&](JobTransaction& job) -> absl::Status {
    LITAGS_RETURN_IF_ERROR(NextState(job.job.state, JobAction::kUpload).status());
    LITAGS_ASSIGN_OR_RETURN(const std::vector<FileRecord> files, job.Files());
    const bool known = std::any_of(files.begin(), files.end(), [&](const FileRecord& f) {
      return f.role == file.role && f.name == file.name;
    });
    if (!known && static_cast<int64_t>(files.size()) >= limits.max_files) {
      return MakeError(absl::StatusCode::kResourceExhausted, "TOO_MANY_FILES", "images",
                       absl::StrCat("a job may have ", limits.max_files,
                                    " files; upload fewer or split the capture"));
    }
    for (const FileRecord& f : files) {
      if (file.role == FileRole::kCameras && f.role == file.role && f.name != file.name) {
        return InvalidInput(
            "CAMERAS_TWICE", absl::StrCat("cameras[", file.name, "]"),
            absl::StrCat("the job has the cameras file ", f.name, " already; a job takes one"));
      }
    }
    return job.PutFile(file);
  };
  return store_->Update(id, change).status();
}

absl::Status Jobs::Enqueue(JobTransaction& job, std::string_view message) {
  const JobAction action =
      job.job.state == JobState::kUploading ? JobAction::kStart : JobAction::kResume;
  LITAGS_RETURN_IF_ERROR(NextState(job.job.state, action).status());
  LITAGS_ASSIGN_OR_RETURN(const std::vector<FileRecord> files, job.Files());
  LITAGS_RETURN_IF_ERROR(CheckPhotos(files));
  job.job.attempt = 0;
  return ApplyAction(job, action, clock_(), message);
}

absl::StatusOr<JobRecord> Jobs::Start(std::string_view id) {
  return store_->Update(id, [&](JobTransaction& job) -> absl::Status {
    LITAGS_RETURN_IF_ERROR(NextState(job.job.state, JobAction::kStart).status());
    return Enqueue(job, "started");
  });
}

absl::StatusOr<JobRecord> Jobs::Resume(std::string_view id) {
  return store_->Update(id, [&](JobTransaction& job) -> absl::Status {
    LITAGS_RETURN_IF_ERROR(NextState(job.job.state, JobAction::kResume).status());
    return Enqueue(job, "resumed");
  });
}

absl::StatusOr<JobRecord> Jobs::Cancel(std::string_view id) {
  return store_->Update(id, [&](JobTransaction& job) {
    // A running job only learns of the wish; its worker takes it to CANCELLED.
    job.job.cancel_requested = job.job.state == JobState::kRunning;
    return ApplyAction(job, JobAction::kCancel, clock_(), "cancelled on request");
  });
}

absl::Status Jobs::Delete(std::string_view id) {
  const auto change = [](JobTransaction& job) -> absl::Status {
    LITAGS_RETURN_IF_ERROR(NextState(job.job.state, JobAction::kRemove).status());
    return job.Remove();
  };
  LITAGS_RETURN_IF_ERROR(store_->Update(id, change).status());
  LITAGS_RETURN_IF_ERROR(blobs_->RemoveFolder(absl::StrCat("jobs/", std::string(id))));
  std::error_code error;
  std::filesystem::remove_all(data_.work(id), error);
  if (error) {
    return MakeError(absl::StatusCode::kInternal, "STORE_FAILED", "",
                     absl::StrCat("the job is deleted, but its work folder could not be removed: ",
                                  error.message()));
  }
  return absl::OkStatus();
}

}  // namespace litags
