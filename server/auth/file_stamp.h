#ifndef LITAGS_SERVER_AUTH_FILE_STAMP_H_
#define LITAGS_SERVER_AUTH_FILE_STAMP_H_

#include <sys/stat.h>

#include <chrono>
#include <cstdint>
#include <string>

namespace litags {

// Files that may change while the server runs are looked at no more often.
inline constexpr std::chrono::seconds kLookInterval{1};

// Tells whether a file is another one than before, without reading it. Follows links.
struct FileStamp {
  uint64_t device = 0, inode = 0;
  int64_t size = -1;  // -1: there is no such file
  int64_t seconds = 0, nanoseconds = 0;
  int64_t changed_seconds = 0, changed_nanoseconds = 0;  // who may read it, too

  static FileStamp Of(const std::string& path) {
    struct stat info = {};
    if (stat(path.c_str(), &info) != 0) return {};
    return {info.st_dev,          info.st_ino,         info.st_size,        info.st_mtim.tv_sec,
            info.st_mtim.tv_nsec, info.st_ctim.tv_sec, info.st_ctim.tv_nsec};
  }
  bool operator==(const FileStamp&) const = default;
};

}  // namespace litags

#endif  // LITAGS_SERVER_AUTH_FILE_STAMP_H_
