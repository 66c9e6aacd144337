#include "server/worker/hardening.h"

#include <fcntl.h>
#include <sched.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <new>
#include <string_view>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "engine/core/file_ruleset.h"
#include "engine/core/sandbox.h"

namespace litags {
namespace {

// The least that the programs and their libraries need to start.
constexpr int64_t kLeastMemoryBytes = int64_t{512} << 20;

[[noreturn]] void OnOutOfMemory() {
  // Nothing here may allocate.
  constexpr std::string_view kText = "litags-worker: out of memory\n";
  [[maybe_unused]] const ssize_t n = write(STDERR_FILENO, kText.data(), kText.size());
  _exit(kOutOfMemoryExitCode);
}

// Never raises a limit that is lower already.
bool LowerLimit(__rlimit_resource resource, int64_t value) {
  rlimit limit;
  if (getrlimit(resource, &limit) != 0) return false;
  const auto wanted = static_cast<rlim_t>(value);
  if (limit.rlim_max != RLIM_INFINITY && limit.rlim_max < wanted) return true;
  limit.rlim_cur = limit.rlim_max = wanted;
  return setrlimit(resource, &limit) == 0;
}

bool WriteText(const char* path, const std::string& text) {
  const int fd = open(path, O_WRONLY | O_CLOEXEC);
  if (fd < 0) return false;
  const bool written = write(fd, text.data(), text.size()) == static_cast<ssize_t>(text.size());
  const int error = errno;
  close(fd);
  errno = error;
  return written;
}

// An empty network namespace: not even loopback is up in it. Without the privilege, by way of a
// user namespace, in which this user stays who it is.
bool LeaveNetwork() {
  if (unshare(CLONE_NEWNET) == 0) return true;
  const uid_t uid = getuid();
  const gid_t gid = getgid();
  if (unshare(CLONE_NEWUSER | CLONE_NEWNET) != 0) return false;
  return WriteText("/proc/self/uid_map", absl::StrCat(uid, " ", uid, " 1")) &&
         WriteText("/proc/self/setgroups", "deny") &&
         WriteText("/proc/self/gid_map", absl::StrCat(gid, " ", gid, " 1"));
}

}  // namespace

absl::Status HardeningOptions::Validate() const {
  if (max_memory_bytes != 0 && max_memory_bytes < kLeastMemoryBytes) {
    return InvalidInput("OUT_OF_RANGE", "max_memory_bytes",
                        absl::StrCat("a memory limit of ", max_memory_bytes,
                                     " bytes is too small for a worker to start; give at least ",
                                     kLeastMemoryBytes >> 20, " MiB, or 0 for no limit"));
  }
  return absl::OkStatus();
}

std::vector<std::string> HardenProcess(const HardeningOptions& options) {
  std::vector<std::string> refused;
  const auto note = [&refused](bool done, std::string_view what) {
    if (!done) refused.push_back(absl::StrCat(std::string(what), ": ", strerror(errno)));
  };
  std::set_new_handler(OnOutOfMemory);
  // A file beyond its limit is a failed write, not a signal.
  signal(SIGXFSZ, SIG_IGN);
  note(prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) == 0, "no new privileges");
  note(LowerLimit(RLIMIT_CORE, 0), "no core dumps");
  note(LowerLimit(RLIMIT_FSIZE, kMaxFileBytes), "file size limit");
  if (options.max_memory_bytes > 0) {
    note(LowerLimit(RLIMIT_AS, options.max_memory_bytes), "memory limit");
  }
  const bool left = options.allow_network || LeaveNetwork();
  const Sockets sockets = options.allow_network ? Sockets::kAll : Sockets::kLocal;
  // After the line above, which it would refuse; one of the two is enough.
  errno = SyscallFilter::ForProgram(sockets).Apply();
  if (errno != 0) {
    note(false, "fewer system calls, for COLMAP neither");
    if (!left) note(false, "no network");
  }
  note(FileRuleset::Supported(), "COLMAP kept from files that are not the job's (Landlock)");
  HideFromOtherProcesses();
  return refused;
}

}  // namespace litags
