#include "server/worker/scratch_folder.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <filesystem>

#include "server/store/blob_store.h"
#include "server/store/digest.h"
#include "server/store/file_error.h"

namespace litags {
namespace {

namespace fs = std::filesystem;

constexpr int kTries = 10;

// The folder, locked; -1 if it is gone or somebody else has it.
int LockFolder(const std::string& path) {
  const int fd = open(path.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  if (fd < 0) return -1;
  struct stat opened, there;
  if (flock(fd, LOCK_EX | LOCK_NB) == 0 && fstat(fd, &opened) == 0 &&
      stat(path.c_str(), &there) == 0 && opened.st_ino == there.st_ino) {
    return fd;
  }
  const int error = errno;
  close(fd);
  errno = error;
  return -1;
}

}  // namespace

absl::StatusOr<std::unique_ptr<ScratchFolder>> ScratchFolder::Make(const std::string& root) {
  RemoveAbandoned(root);
  for (int attempt = 1;; ++attempt) {
    std::string path = root + "/" + RandomHex(8);
    if (mkdir(path.c_str(), 0700) != 0) return FileError("create", path, errno);
    const int fd = LockFolder(path);
    if (fd >= 0) return std::unique_ptr<ScratchFolder>(new ScratchFolder(std::move(path), fd));
    // Another worker took it for abandoned, in the moment before it was locked; or nothing can be
    // locked there.
    if (attempt == kTries) return FileError("lock", path, errno);
  }
}

ScratchFolder::~ScratchFolder() {
  std::error_code error;  // what stays is removed when the next one is made
  fs::remove_all(path_, error);
  close(fd_);
}

void ScratchFolder::RemoveAbandoned(const std::string& root) {
  const auto entries = ListFolder(root);
  if (!entries.ok()) return;
  for (const FolderEntry& entry : *entries) {
    const std::string path = root + "/" + entry.name;
    const int fd = LockFolder(path);
    if (fd < 0) continue;
    std::error_code error;
    fs::remove_all(path, error);
    close(fd);
  }
}

}  // namespace litags
