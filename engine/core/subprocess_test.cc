#include "engine/core/subprocess.h"

#include <fcntl.h>
#include <signal.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <thread>
#include <vector>

#include "absl/strings/str_cat.h"
#include "engine/core/error_test_util.h"
#include "engine/core/temp_dir_test_util.h"
#include "gmock/gmock.h"
#include "gtest/gtest.h"

namespace litags {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Not;

namespace fs = std::filesystem;

SubprocessOptions Shell(const std::string& script) {
  SubprocessOptions options;
  options.args = {"/bin/sh", "-c", script};
  return options;
}

absl::StatusOr<SubprocessResult> Execute(const SubprocessOptions& options) {
  return RunSubprocess(options, CancelToken());
}

double SecondsSince(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

std::string Contents(const fs::path& path) {
  std::ifstream file(path);
  return {std::istreambuf_iterator<char>(file), {}};
}

// Whether the process is running; a zombie that its new parent has yet to reap is not.
bool IsAlive(int pid) {
  const std::string stat = Contents("/proc/" + std::to_string(pid) + "/stat");
  const size_t end_of_name = stat.rfind(')');
  return end_of_name != std::string::npos && stat.substr(end_of_name + 2, 1) != "Z";
}

bool DiesSoon(int pid) {
  for (int i = 0; i < 100 && IsAlive(pid); ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
  }
  return !IsAlive(pid);
}

class SubprocessTest : public ::testing::Test {
 protected:
  // A script that runs in dir_.
  SubprocessOptions ShellHere(const std::string& script) {
    return Shell(absl::StrCat("cd '", dir_.string(), "'; ", script));
  }

  // The process id that a script wrote with `echo $! > pid`, once it is there.
  int WaitForPid() {
    for (int i = 0; i < 200; ++i) {
      const std::string text = Contents(dir_ / "pid");
      if (!text.empty() && text.back() == '\n') return std::stoi(text);
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
    return -1;
  }

  const TempDir temporary_;
  const fs::path dir_ = temporary_.path();
};

TEST_F(SubprocessTest, ReturnsExitCodeAndLastLines) {
  SubprocessOptions options = Shell("echo one; echo two >&2; echo three; exit 7");
  options.tail_lines = 2;
  const auto result = Execute(options);
  ASSERT_TRUE(result.ok()) << result.status();
  EXPECT_EQ(result->exit_code, 7);
  EXPECT_EQ(result->tail, "two\nthree");
}

TEST_F(SubprocessTest, PassesArgumentsWithoutAShell) {
  SubprocessOptions options;
  options.args = {"printf", "%s|", "a b", "$HOME", "; rm x", "*", ""};
  const auto result = Execute(options);
  ASSERT_TRUE(result.ok()) << result.status();
  EXPECT_EQ(result->tail, "a b|$HOME|; rm x|*||");
}

TEST_F(SubprocessTest, AddsAndReplacesEnvironment) {
  setenv("LC_TEST_KEPT", "kept", 1);
  setenv("LC_TEST_OLD", "old", 1);
  SubprocessOptions options = Shell("echo $LC_TEST_KEPT $LC_TEST_OLD $LITAGS_TEST_NEW");
  options.env = {"LC_TEST_OLD=replaced", "LITAGS_TEST_NEW=added"};
  const auto result = Execute(options);
  ASSERT_TRUE(result.ok()) << result.status();
  EXPECT_EQ(result->tail, "kept replaced added");
}

TEST_F(SubprocessTest, WritesTheWholeOutputToTheLogAndEachLineToTheCallback) {
  SubprocessOptions options = Shell("echo first; printf 'half\\rlast'");
  options.log_path = dir_ / "log";
  std::vector<std::string> lines;
  options.on_line = [&](std::string_view line) { lines.emplace_back(line); };
  const auto result = Execute(options);
  ASSERT_TRUE(result.ok()) << result.status();
  EXPECT_EQ(Contents(dir_ / "log"), "first\nhalf\rlast");
  EXPECT_THAT(lines, ElementsAre("first", "half", "last"));
}

TEST_F(SubprocessTest, CutsALogThatGrowsTooLong) {
  SubprocessOptions options =
      Shell(absl::StrCat("head -c ", kMaxLogBytes + 100000, " /dev/zero; echo; echo the end"));
  options.log_path = dir_ / "log";
  options.tail_lines = 1;
  const auto result = Execute(options);
  ASSERT_TRUE(result.ok()) << result.status();
  EXPECT_EQ(static_cast<int64_t>(fs::file_size(dir_ / "log")), kMaxLogBytes);
  EXPECT_EQ(result->tail, "the end");
}

TEST_F(SubprocessTest, AMissingProgramIsNamedWithItsRemedy) {
  for (const std::string& name :
       {std::string("no-such-program-here"), (dir_ / "x").string(), dir_.string()}) {
    SubprocessOptions options;
    options.args = {name};
    const auto result = Execute(options);
    EXPECT_EQ(result.status().code(), absl::StatusCode::kFailedPrecondition) << name;
    EXPECT_EQ(Reason(result.status()), "PROGRAM_NOT_FOUND") << name;
    EXPECT_THAT(std::string(result.status().message()), HasSubstr(name));
    EXPECT_THAT(std::string(result.status().message()), HasSubstr("install"));
  }
}

TEST_F(SubprocessTest, AProgramThatCannotStartIsAnError) {
  const fs::path script = dir_ / "script";
  std::ofstream(script) << "#!/no/such/interpreter\n";
  fs::permissions(script, fs::perms::owner_all);
  SubprocessOptions options;
  options.args = {script};
  EXPECT_EQ(Reason(Execute(options).status()), "PROGRAM_NOT_STARTED");
}

TEST_F(SubprocessTest, ASignalIsReportedByNumberWithTheLastOutput) {
  const auto result = Execute(Shell("echo so far; kill -11 $$"));
  EXPECT_EQ(result.status().code(), absl::StatusCode::kInternal);
  EXPECT_EQ(Reason(result.status()), "PROGRAM_CRASHED");
  EXPECT_THAT(std::string(result.status().message()), HasSubstr("signal 11"));
  EXPECT_THAT(std::string(result.status().message()), HasSubstr("so far"));
  EXPECT_EQ(Reason(Execute(Shell("kill -9 $$")).status()), "PROGRAM_KILLED");
}

TEST_F(SubprocessTest, ATimeoutEndsTheProgramAndItsChildren) {
  SubprocessOptions options = ShellHere("sleep 300 & echo $! > pid; wait");
  options.timeout_seconds = 0.3;
  const auto start = std::chrono::steady_clock::now();
  const auto result = Execute(options);
  EXPECT_EQ(result.status().code(), absl::StatusCode::kDeadlineExceeded);
  EXPECT_EQ(Reason(result.status()), "PROGRAM_TIMEOUT");
  EXPECT_LT(SecondsSince(start), 5.0);  // the sleep is 300 s: any small bound tells
  EXPECT_TRUE(DiesSoon(WaitForPid()));
}

TEST_F(SubprocessTest, CancellingKillsAProgramThatIgnoresSigterm) {
  SubprocessOptions options =
      ShellHere("trap '' TERM; sleep 300 & echo $! > pid; while :; do sleep 0.05; done");
  options.grace_seconds = 0.2;
  CancelToken cancel;
  absl::Status status;
  std::thread runner([&] { status = RunSubprocess(options, cancel).status(); });
  const int pid = WaitForPid();
  const auto start = std::chrono::steady_clock::now();
  cancel.Cancel();
  runner.join();
  EXPECT_EQ(status.code(), absl::StatusCode::kCancelled);
  EXPECT_LT(SecondsSince(start), 30);  // grace 0.2 s, poll 20 ms; the rest is a loaded machine
  EXPECT_TRUE(DiesSoon(pid));
}

TEST_F(SubprocessTest, ARaisedTokenStartsNothing) {
  SubprocessOptions options = ShellHere("echo > started");
  CancelToken cancel;
  cancel.Cancel();
  EXPECT_EQ(RunSubprocess(options, cancel).status().code(), absl::StatusCode::kCancelled);
  EXPECT_FALSE(fs::exists(dir_ / "started"));
}

TEST_F(SubprocessTest, SigtermReachesTheProgramAlthoughWeBlockIt) {
  sigset_t term, previous;
  sigemptyset(&term);
  sigaddset(&term, SIGTERM);
  pthread_sigmask(SIG_BLOCK, &term, &previous);
  SubprocessOptions options = Shell("exec sleep 300");
  options.timeout_seconds = 0.1;
  options.grace_seconds = 60;
  const auto start = std::chrono::steady_clock::now();
  const auto result = Execute(options);
  pthread_sigmask(SIG_SETMASK, &previous, nullptr);
  EXPECT_EQ(result.status().code(), absl::StatusCode::kDeadlineExceeded);
  EXPECT_LT(SecondsSince(start), 10.0);  // a blocked SIGTERM would cost the grace of 60 s
}

TEST_F(SubprocessTest, WhatTheProgramLeftRunningIsKilledWhenItEnds) {
  SubprocessOptions options = ShellHere("sleep 300 & echo $! > pid");
  const auto start = std::chrono::steady_clock::now();
  const auto result = Execute(options);
  ASSERT_TRUE(result.ok()) << result.status();
  EXPECT_LT(SecondsSince(start), 5.0);
  EXPECT_TRUE(DiesSoon(WaitForPid()));
}

TEST_F(SubprocessTest, TheChildDiesWithItsParent) {
  const pid_t parent = fork();
  if (parent == 0) {
    SubprocessOptions options = ShellHere("echo $$ > pid; exec sleep 300");
    (void)Execute(options);
    _exit(0);
  }
  const int child = WaitForPid();
  ASSERT_TRUE(IsAlive(child));
  kill(parent, SIGKILL);
  waitpid(parent, nullptr, 0);
  EXPECT_TRUE(DiesSoon(child));
}

TEST_F(SubprocessTest, TheChildInheritsNoOpenFile) {
  const int leaked = open("/dev/null", O_RDONLY);  // without O_CLOEXEC
  const auto result = Execute(Shell("ls -l /proc/$$/fd"));
  close(leaked);
  ASSERT_TRUE(result.ok()) << result.status();
  EXPECT_THAT(result->tail, HasSubstr(" 2 -> "));
  EXPECT_THAT(result->tail, Not(HasSubstr(absl::StrCat(" ", leaked, " -> "))));
}

TEST_F(SubprocessTest, ReadsTheFileItIsGiven) {
  std::ofstream(dir_ / "in") << "from the file\n";
  const int file = open((dir_ / "in").c_str(), O_RDONLY | O_CLOEXEC);
  SubprocessOptions options = Shell("cat");
  options.input_fd = file;
  const auto result = Execute(options);
  close(file);
  ASSERT_TRUE(result.ok()) << result.status();
  EXPECT_EQ(result->tail, "from the file");
}

// As a program that was started with `n>&-` for each of them.
TEST_F(SubprocessTest, TheChildHasItsStreamsAlthoughWeHaveNone) {
  std::ofstream(dir_ / "in") << "from the file\n";
  const auto run_without = [&](const std::vector<int>& closed, bool file) {
    const pid_t child = fork();
    if (child == 0) {
      for (const int fd : closed) close(fd);
      SubprocessOptions options = Shell(file ? "cat; echo err >&2" : "cat; echo out; echo err >&2");
      if (file) options.input_fd = open((dir_ / "in").c_str(), O_RDONLY | O_CLOEXEC);
      const auto result = Execute(options);
      _exit(!result.ok() ? 2 : result->tail == (file ? "from the file\nerr" : "out\nerr") ? 0 : 1);
    }
    int status = 0;
    EXPECT_EQ(waitpid(child, &status, 0), child);
    return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  };
  for (const std::vector<int>& closed :
       {std::vector<int>{0}, {1}, {2}, {0, 1}, {0, 2}, {1, 2}, {0, 1, 2}}) {
    EXPECT_EQ(run_without(closed, false), 0) << testing::PrintToString(closed);
    EXPECT_EQ(run_without(closed, true), 0) << testing::PrintToString(closed);
  }
}

TEST_F(SubprocessTest, LowersPriority) {
  SubprocessOptions options = Shell("nice");
  options.niceness = 5;
  const auto result = Execute(options);
  ASSERT_TRUE(result.ok()) << result.status();
  EXPECT_EQ(result->tail, absl::StrCat(std::min(19, nice(0) + 5)));
}

TEST_F(SubprocessTest, OptionsNameTheFieldThatBreaksItsRule) {
  SubprocessOptions options;
  EXPECT_EQ(GetErrorDetail(options.Validate())->field, "args");
  EXPECT_EQ(Reason(options.Validate()), "ARGUMENT_MISSING");
  options.args = {"true"};
  EXPECT_TRUE(options.Validate().ok());
  options.env = {"novalue"};
  EXPECT_EQ(GetErrorDetail(options.Validate())->field, "env");
  options.env.clear();
  options.niceness = 20;
  EXPECT_EQ(GetErrorDetail(options.Validate())->field, "niceness");
}

}  // namespace
}  // namespace litags
