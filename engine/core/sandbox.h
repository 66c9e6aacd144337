// What processes that touch strangers' bytes give up: our environment, system calls, powers of
// root.
#ifndef LITAGS_ENGINE_CORE_SANDBOX_H_
#define LITAGS_ENGINE_CORE_SANDBOX_H_

#include <linux/filter.h>
#include <sys/resource.h>

#include <cstdint>
#include <string>
#include <vector>

namespace litags {

// Built with a sanitizer: it reserves terabytes of address space, keeps freed memory for a while,
// and looks into its own process as a debugger does.
#if defined(__SANITIZE_ADDRESS__) || defined(LITAGS_TSAN)
inline constexpr bool kBuiltWithSanitizer = true;
#else
inline constexpr bool kBuiltWithSanitizer = false;
#endif

// The environment of child programs: of ours only what programs need to run here (where programs,
// temporary files and the display are, language, threads), with `changes` applied ("NAME=value").
// Everything else may be a secret: keys of S3, passwords of PostgreSQL, tokens.
std::vector<std::string> ChildEnvironment(const std::vector<std::string>& changes);

enum class Sockets {
  kNone,
  kLocal,  // Unix sockets: databases on this machine
  kAll,
};

// System calls that a thread, and all it starts from then on, can no longer make (seccomp). Works
// without any privilege.
class SyscallFilter {
 public:
  // For whole programs. Refused are, besides sockets: looking into other processes, namespaces,
  // mounts, kernel modules, keys, BPF, the clock, and io_uring, which would go around this.
  static SyscallFilter ForProgram(Sockets sockets);
  // For code that computes on what is in memory or open already: no new files, no new processes.
  static SyscallFilter ForComputing();

  // Whether this kernel has filters.
  static bool Supported();
  // 0, or errno. Without Supported() nothing is refused. Async-signal-safe.
  int Apply() const;

 private:
  std::vector<sock_filter> program_;
};

// Of root's powers this process keeps those over files. 0, or errno. Async-signal-safe.
int KeepFilePowersOnly();

// This process gets no more of it than `value`; where it is told first, as of its processor time,
// `value + more` ends it. Async-signal-safe.
void LimitResource(__rlimit_resource resource, int64_t value, int64_t more = 0);

// Other processes of this user cannot look into this one: its environment and memory hold secrets.
// There are no core dumps then either.
void HideFromOtherProcesses();

}  // namespace litags

#endif  // LITAGS_ENGINE_CORE_SANDBOX_H_
