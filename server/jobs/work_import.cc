#include "server/jobs/work_import.h"

#include <spdlog/spdlog.h>

#include <charconv>
#include <filesystem>
#include <string_view>

#include "server/jobs/codec.h"
#include "server/jobs/kept_files.h"
#include "server/store/digest.h"
#include "server/store/file_error.h"

namespace litags {
namespace {

namespace fs = std::filesystem;

struct OldFolder {
  int64_t lease = 0;  // 0: of before there were lease folders
  fs::path path;
};

// That of the newest lease; leases of a job before it lost their folder to it.
absl::StatusOr<OldFolder> NewestIn(const fs::path& folder) {
  constexpr std::string_view kPrefix = "lease-";
  OldFolder newest{0, folder / "run"};
  LITAGS_ASSIGN_OR_RETURN(const auto entries, ListFolder(folder));
  for (const FolderEntry& entry : entries) {
    if (!entry.name.starts_with(kPrefix)) continue;
    int64_t lease = 0;
    std::from_chars(entry.name.data() + kPrefix.size(), entry.name.data() + entry.name.size(),
                    lease);
    if (lease > newest.lease) newest = {lease, folder / entry.name / "run"};
  }
  return newest;
}

absl::Status Import(JobStore* store, BlobStore* blobs, const DataDir& data, const JobRecord& job) {
  LITAGS_ASSIGN_OR_RETURN(const OldFolder work, NewestIn(data.work() + "/" + job.id));
  KeptFiles kept;
  for (const std::string& name : FilesWorthKeeping(work.path)) {
    LITAGS_ASSIGN_OR_RETURN(kept[name],
                            StoreFile(blobs, job.id, work.lease, work.path / name,
                                      data.tmp() + "/import-" + RandomHex(8), KeptFile()));
  }
  const auto change = [&](JobTransaction& transaction) {
    SetKept(&transaction.job, kept);
    return absl::OkStatus();
  };
  return store->Update(job.id, change).status();
}

}  // namespace

absl::Status ImportWorkFolders(JobStore* store, BlobStore* blobs, const DataDir& data) {
  LITAGS_ASSIGN_OR_RETURN(const auto entries, ListFolder(data.work()));
  int imported = 0;
  std::error_code error;
  for (const FolderEntry& entry : entries) {
    const auto job = store->Get(entry.name);
    if (absl::IsNotFound(job.status())) {
      spdlog::warn("{}/{} belongs to no job", data.work(), entry.name);
      continue;
    }
    LITAGS_RETURN_IF_ERROR(job.status());
    if (job->kept.empty()) {  // else this was interrupted below
      LITAGS_RETURN_IF_ERROR(Import(store, blobs, data, *job));
    }
    const fs::path folder = fs::path(data.work()) / entry.name;
    fs::remove_all(folder, error);
    if (error) return FileError("remove", folder, error.value());
    ++imported;
  }
  fs::remove(data.work(), error);  // if it is empty now
  if (imported > 0) spdlog::info("checkpoints and scenes of {} jobs are blobs now", imported);
  return absl::OkStatus();
}

}  // namespace litags
