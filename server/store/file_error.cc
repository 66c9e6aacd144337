#include "server/store/file_error.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <vector>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "engine/core/unique_fd.h"

namespace litags {
namespace {

int CopyBytes(int from, int to) {
  std::vector<char> buffer(1 << 20);
  for (;;) {
    const ssize_t n = read(from, buffer.data(), buffer.size());
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) return errno;
    if (n == 0) return 0;
    if (const int error = WriteAll(to, {buffer.data(), static_cast<size_t>(n)})) return error;
  }
}

}  // namespace

absl::Status FileError(const char* action, const std::string& path, int error) {
  if (error == ENOSPC || error == EDQUOT) {
    return MakeError(absl::StatusCode::kResourceExhausted, "DISK_FULL", "",
                     "the disk of the server's data folder is full; free some space there");
  }
  return MakeError(absl::StatusCode::kInternal, "STORE_FAILED", "",
                   absl::StrCat("cannot ", action, " ", path, ": ", std::strerror(error)));
}

int WriteAll(int fd, std::string_view bytes, int64_t* written) {
  while (!bytes.empty()) {
    const ssize_t n = write(fd, bytes.data(), bytes.size());
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) return errno;
    if (written) *written += n;
    bytes.remove_prefix(static_cast<size_t>(n));
  }
  return 0;
}

int CopyFile(const std::string& source, const std::string& target) {
  const UniqueFd from(open(source.c_str(), O_RDONLY | O_CLOEXEC));
  if (!from.valid()) return errno;
  UniqueFd to(open(target.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600));
  if (!to.valid()) return errno;
  int error = CopyBytes(from.get(), to.get());
  // A network's file system may find out only now that there is no room.
  if (!to.Close() && error == 0) error = errno;
  if (error != 0) unlink(target.c_str());
  return error;
}

bool HasReason(const absl::Status& status, std::string_view reason) {
  const auto detail = GetErrorDetail(status);
  return detail && detail->reason == reason;
}

std::string MessageWithReason(const absl::Status& status) {
  const auto detail = GetErrorDetail(status);
  return absl::StrCat(std::string(status.message()), " (",
                      detail ? detail->reason : absl::StatusCodeToString(status.code()), ")");
}

}  // namespace litags
