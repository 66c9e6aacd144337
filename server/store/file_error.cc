#include "server/store/file_error.h"

#include <cerrno>
#include <cstring>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"

namespace litags {

absl::Status FileError(const char* action, const std::string& path, int error) {
  if (error == ENOSPC || error == EDQUOT) {
    return MakeError(absl::StatusCode::kResourceExhausted, "DISK_FULL", "",
                     "the disk of the server's data folder is full; free some space there");
  }
  return MakeError(absl::StatusCode::kInternal, "STORE_FAILED", "",
                   absl::StrCat("cannot ", action, " ", path, ": ", std::strerror(error)));
}

}  // namespace litags
