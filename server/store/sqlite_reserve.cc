#include "server/store/sqlite_reserve.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <unistd.h>

#include <algorithm>

#include "engine/core/unique_fd.h"

namespace litags {
namespace {

// The rest is kept from those who write at the same time, as uploads do.
constexpr int64_t kPartBytes = int64_t{1} << 20;
// A smaller rest of the disk is left to what is being written.
constexpr int64_t kLeastFreeBytes = 2 * kReserveBytes;
// Several times the first piece of SQLite's shared memory, 32 KiB.
constexpr int64_t kOpenBytes = int64_t{256} << 10;

std::string PathOf(const std::string& store_path) { return store_path + "-reserve"; }

// Free bytes of the disk of an open file; 0 if that cannot be told.
int64_t FreeBytes(const UniqueFd& fd) {
  struct statvfs disk = {};
  if (fstatvfs(fd.get(), &disk) != 0) return 0;
  return static_cast<int64_t>(disk.f_bavail) * static_cast<int64_t>(disk.f_frsize);
}

}  // namespace

bool FillReserve(const std::string& store_path) {
  const UniqueFd fd(open(PathOf(store_path).c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0600));
  return fd.valid() && FreeBytes(fd) >= kLeastFreeBytes &&
         posix_fallocate(fd.get(), 0, kReserveBytes) == 0;
}

bool DrawOnReserve(const std::string& store_path) {
  const UniqueFd fd(open(PathOf(store_path).c_str(), O_RDWR | O_CLOEXEC));
  struct stat info = {};
  if (!fd.valid() || fstat(fd.get(), &info) != 0 || info.st_size == 0) return false;
  return ftruncate(fd.get(), std::max<int64_t>(0, info.st_size - kPartBytes)) == 0;
}

void DrawOnReserveToOpen(const std::string& store_path) {
  const UniqueFd fd(open(PathOf(store_path).c_str(), O_RDONLY | O_CLOEXEC));
  if (fd.valid() && FreeBytes(fd) < kOpenBytes) DrawOnReserve(store_path);
}

}  // namespace litags
