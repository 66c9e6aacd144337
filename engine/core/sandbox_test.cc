#include "engine/core/sandbox.h"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sched.h>
#include <signal.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <functional>

#include "engine/core/subprocess.h"

namespace litags {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::Not;

// What `body` returned in a process with the filter.
int Under(const SyscallFilter& filter, const std::function<int()>& body) {
  const pid_t child = fork();
  if (child == 0) _exit(filter.Apply() == 0 ? body() : 255);
  int status = 0;
  waitpid(child, &status, 0);
  return WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
}

int ErrorOf(long result) { return result < 0 ? errno : 0; }

std::string Output(std::string script, bool confined) {
  SubprocessOptions options;
  options.args = {"/bin/sh", "-c", std::move(script)};
  options.confined = confined;
  options.tail_lines = 1000;
  const auto result = RunSubprocess(options, CancelToken());
  return result.ok() ? result->tail : result.status().ToString();
}

TEST(ChildEnvironment, HasWhatProgramsNeedAndNoSecret) {
  setenv("AWS_SECRET_ACCESS_KEY", "SECRET", 1);
  setenv("PGPASSWORD", "SECRET", 1);
  setenv("LITAGS_STORE", "SECRET", 1);
  setenv("OMP_NUM_THREADS", "7", 1);
  setenv("LC_TIME", "C", 1);
  EXPECT_THAT(ChildEnvironment({"QT_QPA_PLATFORM=offscreen", "LC_TIME=POSIX"}),
              AllOf(Contains("OMP_NUM_THREADS=7"), Contains("QT_QPA_PLATFORM=offscreen"),
                    Contains("LC_TIME=POSIX"), Not(Contains("LC_TIME=C")),
                    Contains(HasSubstr("PATH=")), Not(Contains(HasSubstr("SECRET")))));
  EXPECT_THAT(Output("env", false),
              AllOf(HasSubstr("OMP_NUM_THREADS=7"), Not(HasSubstr("SECRET"))));
}

TEST(SyscallFilter, AProgramWithoutSocketsRunsAndCannotMakeOne) {
  const auto filter = SyscallFilter::ForProgram(Sockets::kNone);
  EXPECT_TRUE(SyscallFilter::Supported());
  for (const int family : {AF_INET, AF_INET6, AF_UNIX, AF_NETLINK}) {
    EXPECT_EQ(Under(filter, [&] { return ErrorOf(socket(family, SOCK_DGRAM, 0)); }), EACCES);
  }
  const auto local = SyscallFilter::ForProgram(Sockets::kLocal);
  EXPECT_EQ(Under(local, [] { return ErrorOf(socket(AF_UNIX, SOCK_STREAM, 0)); }), 0);
  EXPECT_EQ(Under(local, [] { return ErrorOf(socket(AF_INET, SOCK_STREAM, 0)); }), EACCES);
  const auto all = SyscallFilter::ForProgram(Sockets::kAll);
  EXPECT_EQ(Under(all, [] { return ErrorOf(socket(AF_INET, SOCK_STREAM, 0)); }), 0);
  EXPECT_EQ(Under(filter, [] { return std::system("test $(expr 1 + 1) = 2"); }), 0);
}

TEST(SyscallFilter, AProgramStaysInItsNamespacesAndAwayFromTheKernel) {
  const auto filter = SyscallFilter::ForProgram(Sockets::kAll);
  EXPECT_EQ(Under(filter, [] { return ErrorOf(unshare(CLONE_NEWUSER)); }), EPERM);
  EXPECT_EQ(Under(filter,
                  [] {
                    const long child = syscall(SYS_clone, CLONE_NEWUSER | SIGCHLD, 0, 0, 0, 0);
                    if (child == 0) _exit(0);
                    return ErrorOf(child);
                  }),
            EPERM);
  EXPECT_EQ(Under(filter, [] { return ErrorOf(syscall(SYS_clone3, nullptr, 0)); }), ENOSYS);
  EXPECT_EQ(Under(filter, [] { return ErrorOf(syscall(SYS_io_uring_setup, 1, nullptr)); }), ENOSYS);
  EXPECT_EQ(Under(filter, [] { return ErrorOf(syscall(SYS_bpf, 0, nullptr, 0)); }), EPERM);
  EXPECT_EQ(Under(filter, [] { return ErrorOf(syscall(SYS_keyctl, 0, 0, 0, 0, 0)); }), EPERM);
  EXPECT_EQ(
      Under(filter,
            [] {
              return ErrorOf(syscall(SYS_process_vm_readv, getppid(), nullptr, 0, nullptr, 0, 0));
            }),
      EPERM);
}

TEST(SyscallFilter, ComputingHasMemoryAndWhatIsOpenAndNothingElse) {
  const auto filter = SyscallFilter::ForComputing();
  EXPECT_EQ(Under(filter,
                  [] {
                    std::string much(size_t{32} << 20, 'x');
                    void* page = mmap(nullptr, 4096, PROT_READ, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
                    return page != MAP_FAILED && write(1, much.data(), 0) == 0 ? 0 : 1;
                  }),
            0);
  EXPECT_EQ(Under(filter, [] { return ErrorOf(open("/etc/passwd", O_RDONLY)); }), EPERM);
  EXPECT_EQ(Under(filter, [] { return ErrorOf(socket(AF_UNIX, SOCK_STREAM, 0)); }), EPERM);
  EXPECT_EQ(Under(filter, [] { return ErrorOf(fork()); }), EPERM);
  EXPECT_EQ(Under(filter, [] { return ErrorOf(kill(getppid(), 0)); }), EPERM);
  EXPECT_EQ(Under(filter, [] { return ErrorOf(execl("/bin/true", "true", nullptr)); }), EPERM);
}

TEST(SyscallFilter, AConfinedProgramHasItFromItsStartAndNoPowersOfRoot) {
  const std::string status = Output("cat /proc/self/status", true);
  EXPECT_THAT(status, HasSubstr("Seccomp:\t2"));
  EXPECT_THAT(status, HasSubstr("NoNewPrivs:\t1"));
  const size_t at = status.find("CapEff:\t");
  ASSERT_NE(at, std::string::npos);
  // Bits 0 to 4 are those over files.
  EXPECT_EQ(std::stoull(status.substr(at + 8), nullptr, 16) & ~0x1fULL, 0u);
  const std::string send = "bash -c 'echo > /dev/udp/127.0.0.1/9' 2>&1 && echo sent";
  EXPECT_EQ(Output(send, false), "sent");
  EXPECT_THAT(Output(send, true), HasSubstr("Permission denied"));
}

}  // namespace
}  // namespace litags
