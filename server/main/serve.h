#ifndef LITAGS_SERVER_MAIN_SERVE_H_
#define LITAGS_SERVER_MAIN_SERVE_H_

#include <string>

#include "absl/status/status.h"
#include "engine/pipeline/engine.h"
#include "server/main/server_flags.h"
#include "server/worker/shutdown_signal.h"

namespace litags {

// Serves until `signal`, with workers that are the program `worker_program`. Errors of
// CheckPrograms(), of what cannot be opened or listened on, and UNAVAILABLE (SERVER_DEAF).
absl::Status Serve(ServerFlags flags, const std::string& worker_program, Engine* engine,
                   const ShutdownSignal& signal);

}  // namespace litags

#endif  // LITAGS_SERVER_MAIN_SERVE_H_
