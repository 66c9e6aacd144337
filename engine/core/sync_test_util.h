// Notes what a test program puts on disk: its own fsync and fdatasync stand before those of the C
// library, also for SQLite. Include it in one file of a program.
#ifndef LITAGS_ENGINE_CORE_SYNC_TEST_UTIL_H_
#define LITAGS_ENGINE_CORE_SYNC_TEST_UTIL_H_

#include <sys/syscall.h>
#include <unistd.h>

#include <filesystem>
#include <mutex>
#include <string>
#include <utility>
#include <vector>

namespace litags {

class SyncedPaths {
 public:
  // Of the files and folders synced since the last call, as they were named then, oldest first.
  std::vector<std::string> Take() {
    std::lock_guard lock(mutex_);
    return std::exchange(paths_, {});
  }
  void Add(int fd) {
    std::error_code error;
    const auto path = std::filesystem::read_symlink("/proc/self/fd/" + std::to_string(fd), error);
    std::lock_guard lock(mutex_);
    paths_.push_back(path.string());
  }

 private:
  std::mutex mutex_;
  std::vector<std::string> paths_;
};

inline SyncedPaths& Synced() {
  static SyncedPaths paths;
  return paths;
}

}  // namespace litags

extern "C" int fsync(int fd) {
  litags::Synced().Add(fd);
  return static_cast<int>(syscall(SYS_fsync, fd));
}

extern "C" int fdatasync(int fd) {
  litags::Synced().Add(fd);
  return static_cast<int>(syscall(SYS_fdatasync, fd));
}

#endif  // LITAGS_ENGINE_CORE_SYNC_TEST_UTIL_H_
