#ifndef LITAGS_SERVER_MAIN_PREFLIGHT_H_
#define LITAGS_SERVER_MAIN_PREFLIGHT_H_

#include <string>

#include "absl/status/status.h"
#include "server/main/server_flags.h"

namespace litags {

// Whether jobs could run, and be told of: the worker's program and settings, the depth network if
// there is one, hosts and certificates of webhooks. FAILED_PRECONDITION (WORKER_NOT_FOUND,
// DEPTH_MODEL_NOT_FOUND, TLS_FILE_UNREADABLE, TLS_FILE_INVALID), INVALID_ARGUMENT (OUT_OF_RANGE,
// LABEL_INVALID, SETTING_INVALID).
absl::Status CheckPrograms(const ServerFlags& flags, const std::string& worker_program);

// litags-server --check: looks at everything that a start needs, and at what jobs will need, and
// prints a line for each: "ok", "note" or "FAIL", what, and why. It changes nothing but a file that
// it makes and removes in the data folder. Returns whether all is well.
bool Preflight(const ServerFlags& flags, const std::string& worker_program);

}  // namespace litags

#endif  // LITAGS_SERVER_MAIN_PREFLIGHT_H_
