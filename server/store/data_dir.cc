#include "server/store/data_dir.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <filesystem>
#include <thread>
#include <vector>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "server/store/blob_store.h"

namespace litags {

namespace fs = std::filesystem;

namespace {

// For a second.
constexpr int kLockTries = 21;
constexpr std::chrono::milliseconds kBetweenLockTries{50};

absl::Status Unusable(const DataDir& dir, const std::error_code& error) {
  return MakeError(absl::StatusCode::kFailedPrecondition, "DATA_DIR_UNUSABLE", "data",
                   absl::StrCat("cannot use ", dir.root, " as the data folder: ", error.message(),
                                "; choose another or fix its permissions"));
}

std::error_code LastError() { return {errno, std::generic_category()}; }

}  // namespace

absl::StatusOr<DataDir> DataDir::Open(const std::string& root) {
  if (root.empty()) {
    return MakeError(absl::StatusCode::kFailedPrecondition, "DATA_DIR_UNUSABLE", "data",
                     "this user has no home folder; name a data folder with --data");
  }
  std::error_code error;
  const fs::path absolute = fs::absolute(root, error).lexically_normal();
  DataDir dir{absolute.string()};
  if (!error) fs::create_directories(absolute.parent_path(), error);
  for (const std::string& folder : {dir.root, dir.scratch(), dir.uploads(), dir.tmp()}) {
    if (error || mkdir(folder.c_str(), 0700) == 0) continue;
    const std::error_code refused = LastError();
    if (fs::is_directory(folder, error)) continue;
    error = refused == std::errc::file_exists ? std::make_error_code(std::errc::not_a_directory)
                                              : refused;
  }
  if (error) return Unusable(dir, error);
  return dir;
}

bool DataDir::OthersMayEnter() const {
  struct stat info = {};
  return stat(root.c_str(), &info) == 0 && (info.st_mode & (S_IRWXG | S_IRWXO)) != 0;
}

void DataDir::EmptyTmp(double quiet_seconds) const {
  std::vector<std::string> folders = {tmp()};
  if (quiet_seconds > 0) folders.push_back(blobs() + "/tmp");  // a worker may be writing there
  for (const std::string& folder : folders) {
    const auto entries = ListFolder(folder);
    if (!entries.ok()) continue;  // the next time, then
    for (const FolderEntry& entry : *entries) {
      if (quiet_seconds > 0 && entry.quiet_seconds < quiet_seconds) continue;
      std::error_code error;  // its owner may have removed it just now
      fs::remove_all(fs::path(folder) / entry.name, error);
    }
  }
}

absl::StatusOr<std::unique_ptr<DataDirLock>> DataDirLock::Take(const DataDir& dir) {
  const int fd = open((dir.root + "/server.lock").c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0600);
  if (fd < 0) return Unusable(dir, LastError());
  for (int tries = 1; tries <= kLockTries; ++tries) {
    if (flock(fd, LOCK_EX | LOCK_NB) == 0) return std::unique_ptr<DataDirLock>(new DataDirLock(fd));
    if (tries < kLockTries) std::this_thread::sleep_for(kBetweenLockTries);
  }
  close(fd);
  return MakeError(absl::StatusCode::kFailedPrecondition, "DATA_DIR_IN_USE", "data",
                   absl::StrCat("another litags-server uses ", dir.root,
                                "; stop it or give this one another --data folder"));
}

DataDirLock::~DataDirLock() { close(fd_); }

}  // namespace litags
