#include "server/worker/work_folder.h"

#include <spdlog/spdlog.h>
#include <sys/stat.h>

#include <algorithm>
#include <filesystem>
#include <utility>

#include "engine/io/work_folder.h"
#include "server/jobs/codec.h"
#include "server/store/digest.h"
#include "server/store/file_error.h"

namespace litags {
namespace {

namespace fs = std::filesystem;

// Tells versions of a file apart: a replaced one has another inode or another time. 0: none there.
int64_t StampOf(const std::string& path) {
  struct stat info = {};
  if (stat(path.c_str(), &info) != 0) return 0;
  return (int64_t{info.st_mtim.tv_sec} * 1'000'000'000 + info.st_mtim.tv_nsec) ^
         static_cast<int64_t>(info.st_ino << 1);
}

}  // namespace

absl::StatusOr<std::unique_ptr<WorkFolder>> WorkFolder::Make(const Lease& lease, BlobStore* blobs,
                                                             const std::string& scratch_root) {
  LITAGS_ASSIGN_OR_RETURN(auto scratch, ScratchFolder::Make(scratch_root));
  std::unique_ptr<WorkFolder> folder(new WorkFolder(lease, blobs, std::move(scratch)));
  std::error_code error;
  for (const std::string& made : {folder->input(), folder->run()}) {
    if (!error) fs::create_directory(made, error);
    if (error) return FileError("create", made, error.value());
  }
  return folder;
}

absl::Status WorkFolder::Fetch(const CancelToken& cancel) {
  if (lease_.job.kept.empty()) return absl::OkStatus();
  LITAGS_ASSIGN_OR_RETURN(kept_, Decode<KeptFiles>(lease_.job.kept));
  for (const auto& [name, file] : kept_) {
    if (name == kFinishedScene) continue;
    LITAGS_RETURN_IF_ERROR(cancel.Check());
    const fs::path path = fs::path(run()) / name, folder = path.parent_path();
    std::error_code error;
    if (!fs::exists(folder)) fs::create_directories(folder, error);
    if (error) return FileError("create", folder, error.value());
    // The engine made it.
    if (folder != run()) LITAGS_RETURN_IF_ERROR(MakeOwnFolder(folder));
    fs::remove(path, error);  // of an interrupted call
    const absl::Status fetched = blobs_->Fetch(BlobKey(lease_.job.id, file.blob), path);
    if (absl::IsNotFound(fetched) || absl::IsDataLoss(fetched)) {
      spdlog::warn("job={} {} cannot be used: {}", lease_.job.id, name, MessageWithReason(fetched));
    } else if (!fetched.ok()) {
      return fetched;
    }
    stamps_[name] = StampOf(path);
  }
  return absl::OkStatus();
}

absl::StatusOr<bool> WorkFolder::Store(const std::vector<std::string>& but) {
  LITAGS_ASSIGN_OR_RETURN(const std::vector<std::string> names, FilesWorthKeeping(run()));
  const auto replace = [&](const std::string& name, const KeptFile& file) {
    KeptFile& kept = kept_[name];
    if (kept == file) return;
    if (!kept.blob.empty()) replaced_.push_back(kept.blob);
    kept = file;
    changed_ = true;
  };
  for (const std::string& name : names) {
    if (std::find(but.begin(), but.end(), name) != but.end()) continue;
    const std::string path = run() + "/" + name;
    const int64_t stamp = StampOf(path);  // before it is read: a newer one is stored again
    if (stamp == 0 || stamps_[name] == stamp) continue;
    const auto known = kept_.find(name);
    const auto file = StoreFile(blobs_, lease_.job.id, lease_.job.last_event, path,
                                scratch_->path() + "/staged-" + RandomHex(8),
                                known == kept_.end() ? KeptFile() : known->second);
    // The blob store's NOT_FOUND is another thing: the file is there, and was not stored.
    if (HasReason(file.status(), "FILE_GONE")) continue;
    LITAGS_RETURN_IF_ERROR(file.status());
    if (known == kept_.end() || known->second != *file) stored_bytes_ += file->bytes;
    replace(name, *file);
    stamps_[name] = stamp;
  }
  for (auto it = kept_.begin(); it != kept_.end();) {
    const std::string name = it->first;
    if (name == kFinishedScene || std::find(names.begin(), names.end(), name) != names.end()) {
      ++it;
      continue;
    }
    replaced_.push_back(it->second.blob);
    it = kept_.erase(it);
    stamps_.erase(name);
    changed_ = true;
  }
  return std::exchange(changed_, false);
}

void WorkFolder::RemoveReplaced() {
  for (const std::string& blob : replaced_) {
    const bool used = std::any_of(kept_.begin(), kept_.end(),
                                  [&](const auto& entry) { return entry.second.blob == blob; });
    if (used) continue;
    // What stays is removed when the job has ended.
    const absl::Status status = blobs_->Remove(BlobKey(lease_.job.id, blob));
    if (!status.ok()) spdlog::warn("job={} {}", lease_.job.id, MessageWithReason(status));
  }
  replaced_.clear();
}

}  // namespace litags
