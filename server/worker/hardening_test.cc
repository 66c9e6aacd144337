#include "server/worker/hardening.h"
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <linux/filter.h>
#include <linux/seccomp.h>
#include <netinet/in.h>
#include <sched.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cstddef>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <string>

#include "absl/strings/str_join.h"
#include "engine/core/error.h"
#include "engine/core/file_ruleset.h"
#include "engine/core/sandbox.h"
#include "engine/core/subprocess.h"
#include "engine/core/temp_dir_test_util.h"

namespace litags {
namespace {

using ::testing::HasSubstr;

// Exit code of a child process that was hardened and then ran `body`, or minus the signal that
// ended it. Assertions do not reach us from there, so `body` returns what it saw.
int InHardenedChild(const HardeningOptions& options, const std::function<int()>& body) {
  const pid_t child = fork();
  if (child == 0) {
    HardenProcess(options);
    _exit(body());
  }
  int status = 0;
  waitpid(child, &status, 0);
  return WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
}

std::string Status() {
  std::ifstream file("/proc/self/status");
  return {std::istreambuf_iterator<char>(file), {}};
}

int64_t HardLimit(__rlimit_resource resource) {
  rlimit limit;
  getrlimit(resource, &limit);
  return static_cast<int64_t>(limit.rlim_max);
}

// A listening socket on loopback, and its address.
int Listen(sockaddr_in* address) {
  const int fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  *address = {};
  address->sin_family = AF_INET;
  address->sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof(*address);
  const bool ok = bind(fd, reinterpret_cast<sockaddr*>(address), size) == 0 && listen(fd, 4) == 0 &&
                  getsockname(fd, reinterpret_cast<sockaddr*>(address), &size) == 0;
  return ok ? fd : -1;
}

// 0, or errno.
int Connect(const sockaddr_in& address) {
  const int fd = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  if (fd < 0) return errno;
  const int result =
      connect(fd, reinterpret_cast<const sockaddr*>(&address), sizeof(address)) == 0 ? 0 : errno;
  close(fd);
  return result;
}

TEST(Hardening, GivesUpPrivilegesAndCoreDumps) {
  EXPECT_EQ(InHardenedChild({},
                            [] {
                              const bool gone =
                                  Status().find("NoNewPrivs:\t1\n") != std::string::npos;
                              return gone && HardLimit(RLIMIT_CORE) == 0 ? 0 : 1;
                            }),
            0);
}

TEST(Hardening, LimitsHoldInProgramsThatItStarts) {
  if (kBuiltWithSanitizer) GTEST_SKIP() << "a sanitizer needs more address space";
  HardeningOptions options;
  options.max_memory_bytes = int64_t{1} << 30;
  EXPECT_EQ(InHardenedChild(options,
                            [] {
                              return std::system(
                                  "test \"$(ulimit -Hv)\" = 1048576 && "
                                  "test \"$(ulimit -Hf)\" = 134217728 && "  // 512 bytes each
                                  "test \"$(ulimit -Hc)\" = 0 && "
                                  "grep -q 'NoNewPrivs:.1' /proc/self/status");
                            }),
            0);
}

TEST(Hardening, FileBeyondItsLimitIsAFailedWrite) {
  TempDir dir;
  HardeningOptions options;
  EXPECT_EQ(InHardenedChild(options,
                            [&] {
                              std::ofstream file(dir.path() + "/file");
                              file.seekp(kMaxFileBytes);
                              file << std::string(5000, 'x') << std::flush;
                              return file.fail() && errno == EFBIG ? 0 : 1;
                            }),
            0);
}

TEST(Hardening, UsedUpMemoryEndsTheProcessWithItsOwnExitCode) {
  if (kBuiltWithSanitizer) GTEST_SKIP() << "a sanitizer needs more address space";
  HardeningOptions options;
  options.max_memory_bytes = int64_t{1} << 30;
  EXPECT_EQ(InHardenedChild(options,
                            [] {
                              const std::string too_much(size_t{4} << 30, 'x');
                              return static_cast<int>(too_much.back() == 'x');
                            }),
            kOutOfMemoryExitCode);
}

TEST(Hardening, NetworkIsOutOfReachUnlessAllowed) {
  sockaddr_in address;
  const int listener = Listen(&address);
  ASSERT_GE(listener, 0);
  HardeningOptions options;
  options.allow_network = true;
  EXPECT_EQ(InHardenedChild(options, [&] { return Connect(address); }), 0);
  options.allow_network = false;
  EXPECT_EQ(InHardenedChild(options, [&] { return Connect(address); }), EACCES);
  // PostgreSQL on this machine is reached so.
  EXPECT_EQ(InHardenedChild(options, [] { return socket(AF_UNIX, SOCK_STREAM, 0) < 0 ? 1 : 0; }),
            0);
  close(listener);
}

TEST(Hardening, OtherProcessesCannotLookIntoIt) {
  if (kBuiltWithSanitizer) GTEST_SKIP() << "a sanitizer looks into its own process";
  EXPECT_EQ(InHardenedChild({}, [] { return prctl(PR_GET_DUMPABLE); }), 0);
}

TEST(Hardening, SystemCallsThatNoWorkerNeedsAreRefused) {
  HardeningOptions options;
  for (const bool network : {false, true}) {
    options.allow_network = network;
    EXPECT_EQ(InHardenedChild(options, [] { return unshare(CLONE_NEWUSER) == 0 ? 0 : errno; }),
              EPERM);
  }
}

TEST(Hardening, FilesStayThoseOfTheUser) {
  TempDir dir;
  std::ofstream(dir.path() + "/before") << "x";
  EXPECT_EQ(InHardenedChild({},
                            [&] {
                              std::ofstream before(dir.path() + "/before", std::ios::app);
                              std::ofstream after(dir.path() + "/after");
                              before << "y" << std::flush;
                              after << "y" << std::flush;
                              return before.good() && after.good() ? 0 : 1;
                            }),
            0);
  EXPECT_TRUE(std::filesystem::exists(dir.path() + "/after"));
}

// What a confined program said that a hardened process started to look into two folders, of which
// one is its own: "own" and "other", where it could.
std::string SeenByConfinedProgram() {
  TempDir own, other;
  std::ofstream(own.path() + "/file") << "own\n";
  std::ofstream(other.path() + "/file") << "other\n";
  SubprocessOptions program;
  program.args = {"/bin/sh", "-c", "cat $0/file $1/file 2> /dev/null", own.path(), other.path()};
  program.confined = true;
  program.files.change = {own.path()};
  const auto result = RunSubprocess(program, CancelToken());
  return result.ok() ? result->tail : result.status().ToString();
}

TEST(Hardening, ConfinedProgramsReadNoFilesButTheirOwn) {
  if (!FileRuleset::Supported()) GTEST_SKIP() << "this kernel has no Landlock";
  EXPECT_EQ(InHardenedChild({}, [] { return SeenByConfinedProgram() == "own" ? 0 : 1; }), 0);
}

// As a kernel without it, or a container that forbids it.
bool ForbidLandlock() {
  sock_filter lines[] = {
      BPF_STMT(BPF_LD | BPF_W | BPF_ABS, offsetof(seccomp_data, nr)),
      BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, SYS_landlock_create_ruleset, 0, 1),
      BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ERRNO | ENOSYS),
      BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ALLOW),
  };
  const sock_fprog program = {std::size(lines), lines};
  return prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) == 0 &&
         prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, &program) == 0;
}

TEST(Hardening, WithoutLandlockItSaysSoAndProgramsRun) {
  EXPECT_EQ(InHardenedChild({},
                            [] {
                              if (!ForbidLandlock()) return 1;
                              const std::string refused = absl::StrJoin(HardenProcess({}), "\n");
                              if (refused.find("(Landlock)") == std::string::npos) return 2;
                              return SeenByConfinedProgram() == "own\nother" ? 0 : 3;
                            }),
            0);
}

TEST(Hardening, MemoryTooSmallToStartInIsRefused) {
  HardeningOptions options;
  options.max_memory_bytes = 1 << 20;
  EXPECT_EQ(GetErrorDetail(options.Validate())->field, "max_memory_bytes");
  EXPECT_THAT(std::string(options.Validate().message()), HasSubstr("512 MiB"));
  options.max_memory_bytes = 0;
  EXPECT_TRUE(options.Validate().ok());
}

}  // namespace
}  // namespace litags
