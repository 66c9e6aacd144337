// What a worker gives up before it touches a client's bytes: photos and models are decoded, and
// COLMAP runs, in processes that can do little else.
#ifndef LITAGS_SERVER_WORKER_HARDENING_H_
#define LITAGS_SERVER_WORKER_HARDENING_H_

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/status.h"

namespace litags {

struct HardeningOptions {
  // Address space of this process, and of every one it starts, bytes (RLIMIT_AS); 0: no limit.
  int64_t max_memory_bytes = 0;
  bool allow_network = false;

  // INVALID_ARGUMENT naming the field that breaks its rule.
  absl::Status Validate() const;
};

// Of any file that a process writes after HardenProcess() (RLIMIT_FSIZE).
constexpr int64_t kMaxFileBytes = int64_t{64} << 30;

// Exit code of a process that ran out of memory after HardenProcess().
constexpr int kOutOfMemoryExitCode = 4;

// Restricts this process and all it will start: no new privileges (set-user-ID programs gain
// nothing), no core dumps (they would hold photos), the limits above, system calls that no worker
// needs (SyscallFilter::ForProgram), and the network but for Unix sockets. Other processes of this
// user, COLMAP for one, cannot look into this one. A process whose memory is used up says so and
// exits with kOutOfMemoryExitCode.
//
// Call before a second thread exists: the kernel moves single-threaded processes only. Returns in
// words what this kernel did not allow, or will not allow COLMAP to be kept from; that is no error.
std::vector<std::string> HardenProcess(const HardeningOptions& options);

}  // namespace litags

#endif  // LITAGS_SERVER_WORKER_HARDENING_H_
