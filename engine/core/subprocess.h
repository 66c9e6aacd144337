// Child programs under supervision: no shell, bounded in time and memory, never left behind.
#ifndef LITAGS_ENGINE_CORE_SUBPROCESS_H_
#define LITAGS_ENGINE_CORE_SUBPROCESS_H_

#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "engine/core/cancel.h"
#include "engine/core/file_ruleset.h"

namespace litags {

inline constexpr int64_t kMaxLogBytes = 64 << 20;

struct SubprocessOptions {
  // args[0] is the program: a path if it holds a '/', else a name searched in PATH. Passed on as
  // they are; no shell sees them.
  std::vector<std::string> args;
  // "NAME=value"; added to, or replacing, what ChildEnvironment() leaves of our own environment.
  std::vector<std::string> env;
  // The first kMaxLogBytes of stdout and stderr go here, replacing the file; empty: no log.
  std::string log_path;
  size_t tail_lines = 20;      // last lines kept for SubprocessResult::tail
  double timeout_seconds = 0;  // wall clock; 0: no limit
  double grace_seconds = 0.5;  // between SIGTERM and SIGKILL when we end the child
  int niceness = 0;            // added to ours, 0..19
  int input_fd = -1;           // its stdin; -1: /dev/null
  // It works on strangers' bytes, and needs no network: SyscallFilter::ForProgram() without
  // sockets, KeepFilePowersOnly(), and of files only `files` and AccessToRun(), as far as the
  // kernel allows.
  bool confined = false;
  FileAccess files;
  std::function<void(std::string_view line)> on_line;  // each output line, in the calling thread

  // INVALID_ARGUMENT naming the field that breaks its rule.
  absl::Status Validate() const;
};

// A program that ended by itself, whatever its exit code.
struct SubprocessResult {
  int exit_code = 0;
  double seconds = 0;  // wall clock
  std::string tail;    // last output lines, joined by '\n'
};

// Runs a program to its end and returns its exit code (a non-zero code is the caller's to judge).
//
// Nothing outlives the call: the child leads its own process group, which is killed when the
// program ends, times out or is cancelled; if this process or the calling thread dies first, the
// kernel kills the child (PR_SET_PDEATHSIG). Only a grandchild that left the group can escape.
// The child gets default signal handling, and none of our open files but `input_fd`.
//
// Errors: FAILED_PRECONDITION PROGRAM_NOT_FOUND or PROGRAM_NOT_STARTED (field: args[0]);
// DEADLINE_EXCEEDED PROGRAM_TIMEOUT; CANCELLED, within grace_seconds + 0.1 s of Cancel();
// INTERNAL PROGRAM_CRASHED when it ended itself by a signal (abort, bad memory access),
// PROGRAM_KILLED when another signal ended it; RESOURCE_EXHAUSTED if no process or pipe could be
// made. Thread-safe. The process must not ignore SIGCHLD nor wait for children it did not start.
absl::StatusOr<SubprocessResult> RunSubprocess(const SubprocessOptions& options,
                                               const CancelToken& cancel);

}  // namespace litags

#endif  // LITAGS_ENGINE_CORE_SUBPROCESS_H_
