#include "server/jobs/kept_files.h"

#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <filesystem>
#include <iterator>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "engine/io/work_folder.h"
#include "server/store/digest.h"
#include "server/store/file_error.h"

namespace litags {
namespace {

namespace fs = std::filesystem;

// See engine/pipeline/README.md: folders that every run that needs them makes anew, and the end of
// a file's name while it is written.
constexpr std::string_view kPassing[] = {"sfm", "photos", "found_masks", "wide_views",
                                         "wide_views_2"};
constexpr std::string_view kUnfinished = "tmp";

absl::Status AddFiles(const fs::path& folder, const std::string& prefix,
                      std::vector<std::string>* files) {
  std::error_code error;
  for (fs::directory_iterator it(folder, error), end; !error && it != end; it.increment(error)) {
    const std::string name = it->path().filename();
    std::error_code gone;
    if (it->is_symlink(gone)) continue;  // its bytes lie elsewhere
    if (it->is_directory(gone)) {
      const bool passing = std::ranges::find(kPassing, name) != std::end(kPassing);
      if (!prefix.empty() || passing) continue;
      LITAGS_RETURN_IF_ERROR(AddFiles(it->path(), name + "/", files));
    } else if (!name.ends_with(kUnfinished) && name != kOwnFolderMarker &&
               it->is_regular_file(gone)) {
      files->push_back(prefix + name);
    }
  }
  // The engine may remove a folder that was listed.
  const bool removed = !prefix.empty() && error == std::errc::no_such_file_or_directory;
  return error && !removed ? FileError("list", folder, error.value()) : absl::OkStatus();
}

// A second name for the file, or a copy where there are none.
absl::Status Stage(const std::string& path, const std::string& staging) {
  if (link(path.c_str(), staging.c_str()) == 0) return absl::OkStatus();
  const int error = errno == ENOENT ? ENOENT : CopyFile(path, staging);
  if (error == ENOENT) {
    return MakeError(absl::StatusCode::kNotFound, "FILE_GONE", "",
                     absl::StrCat(path, " is not there any more"));
  }
  return error ? FileError("copy", path, error) : absl::OkStatus();
}

// A blob must be the bytes themselves: a link would end with what it points to.
absl::Status CheckRegular(const std::string& staging, const std::string& path) {
  struct stat info = {};
  if (lstat(staging.c_str(), &info) != 0) return FileError("read", path, errno);
  return S_ISREG(info.st_mode) ? absl::OkStatus() : FileError("store", path, EINVAL);
}

}  // namespace

std::string BlobKey(std::string_view job_id, std::string_view blob) {
  return absl::StrCat("jobs/", std::string(job_id), "/", std::string(blob));
}

std::string LeaseBlob(int64_t lease, std::string_view sha256) {
  return absl::StrCat(lease, "/", std::string(sha256));
}

absl::StatusOr<std::vector<std::string>> FilesWorthKeeping(const std::string& work_folder) {
  std::vector<std::string> files;
  LITAGS_RETURN_IF_ERROR(AddFiles(work_folder, "", &files));
  return files;
}

absl::StatusOr<KeptFile> StoreFile(BlobStore* blobs, std::string_view job_id, int64_t lease,
                                   const std::string& path, const std::string& staging,
                                   const KeptFile& known) {
  LITAGS_RETURN_IF_ERROR(Stage(path, staging));
  const auto store = [&]() -> absl::StatusOr<KeptFile> {
    LITAGS_RETURN_IF_ERROR(CheckRegular(staging, path));
    LITAGS_ASSIGN_OR_RETURN(const FileDigest read, DigestOfFile(staging));
    if (known.blob.ends_with(absl::StrCat("/", read.sha256))) return known;
    KeptFile file{LeaseBlob(lease, read.sha256), read.bytes};
    LITAGS_RETURN_IF_ERROR(blobs->PutFile(BlobKey(job_id, file.blob), staging));
    return file;
  };
  auto file = store();
  unlink(staging.c_str());  // still there unless the store took it
  return file;
}

}  // namespace litags
