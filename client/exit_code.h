// Exit codes of the program `litags`.
#ifndef LITAGS_CLIENT_EXIT_CODE_H_
#define LITAGS_CLIENT_EXIT_CODE_H_

#include "absl/status/status.h"

namespace litags::client {

// Documented in --help.
enum ExitCode : int {
  kExitOk = 0,
  kExitJobFailed = 1,
  kExitBadInput = 2,
  kExitUnreachable = 3,
  kExitNotFound = 4,
  kExitServerError = 5,
  kExitInterrupted = 130,
};

// The exit code for an error of a call, by its code and detail.
int ExitCodeOf(const absl::Status& status);

}  // namespace litags::client

#endif  // LITAGS_CLIENT_EXIT_CODE_H_
