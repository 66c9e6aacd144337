// How programs around the engine end when they fail: as litags does.
#ifndef LITAGS_ENGINE_TOOLS_FAILURE_FAILURE_H_
#define LITAGS_ENGINE_TOOLS_FAILURE_FAILURE_H_

#include <string>

#include "absl/status/status.h"

namespace litags {

// The exit status: 2 for bad usage and input, 130 if the user interrupted, 1 for the rest; 0 if
// there was no failure.
int ExitCodeOf(const absl::Status& status);

// Says on stderr what failed, with its reason and field. `program`: "litags-train". `hint` follows
// the message: "; run the same command to go on".
void PrintError(const std::string& program, const absl::Status& status,
                const std::string& hint = "");

}  // namespace litags

#endif  // LITAGS_ENGINE_TOOLS_FAILURE_FAILURE_H_
