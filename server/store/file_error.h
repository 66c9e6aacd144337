#ifndef LITAGS_SERVER_STORE_FILE_ERROR_H_
#define LITAGS_SERVER_STORE_FILE_ERROR_H_

#include <cstdint>
#include <string>
#include <string_view>

#include "absl/status/status.h"

namespace litags {

// What `action` ("write") on a file or folder of ours failed with; `error`: errno.
// RESOURCE_EXHAUSTED (DISK_FULL) or INTERNAL (STORE_FAILED).
absl::Status FileError(const char* action, const std::string& path, int error);

// Writes all of it. Returns errno, 0: done. Adds to `written` what was, also before an error.
int WriteAll(int fd, std::string_view bytes, int64_t* written = nullptr);

// Copies a file to `target`, which must not be there and is not there after a failure. Returns
// errno, 0: done. std::filesystem reports a full disk as EIO, and leaves half a file.
int CopyFile(const std::string& source, const std::string& target);

// Whether an error has this reason ("FILE_GONE").
bool HasReason(const absl::Status& status, std::string_view reason);

// What is wrong, for operators, whose page of errors is by reason: "... (DATA_DIR_IN_USE)". The
// code, if there is no reason.
std::string MessageWithReason(const absl::Status& status);

}  // namespace litags

#endif  // LITAGS_SERVER_STORE_FILE_ERROR_H_
