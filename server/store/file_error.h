#ifndef LITAGS_SERVER_STORE_FILE_ERROR_H_
#define LITAGS_SERVER_STORE_FILE_ERROR_H_

#include <string>

#include "absl/status/status.h"

namespace litags {

// What `action` ("write") on a file or folder of ours failed with; `error`: errno.
// RESOURCE_EXHAUSTED (DISK_FULL) or INTERNAL (STORE_FAILED).
absl::Status FileError(const char* action, const std::string& path, int error);

}  // namespace litags

#endif  // LITAGS_SERVER_STORE_FILE_ERROR_H_
