#include "engine/core/subprocess.h"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <deque>
#include <optional>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_split.h"
#include "engine/core/error.h"
#include "engine/core/sandbox.h"
#include "engine/core/unique_fd.h"

namespace litags {
namespace {

using Clock = std::chrono::steady_clock;

// How often cancellation and the deadline are looked at; output and exit wake us at once.
constexpr int kPollMs = 20;
constexpr size_t kMaxLineBytes = 4096;  // longer lines are cut in two

double Seconds(Clock::duration d) { return std::chrono::duration<double>(d).count(); }

struct Pipe {
  UniqueFd read, write;
};

absl::Status SystemError(std::string_view what, int error) {
  return MakeError(absl::StatusCode::kResourceExhausted, "PROCESS_LIMIT", "",
                   absl::StrCat(std::string(what), " failed: ", strerror(error),
                                "; too many processes, open files or too little memory"));
}

// Its ends are no standard streams, not even where we were started without those: the child's
// streams would replace them.
absl::StatusOr<Pipe> MakePipe() {
  int fds[2];
  if (pipe2(fds, O_CLOEXEC) != 0) return SystemError("pipe", errno);
  Pipe pipe = {UniqueFd(fds[0]), UniqueFd(fds[1])};
  for (UniqueFd* end : {&pipe.read, &pipe.write}) {
    if (end->get() > STDERR_FILENO) continue;
    *end = UniqueFd(fcntl(end->get(), F_DUPFD_CLOEXEC, STDERR_FILENO + 1));
    if (!end->valid()) return SystemError("pipe", errno);
  }
  return pipe;
}

bool IsProgram(const std::string& path) {
  struct stat info;
  return stat(path.c_str(), &info) == 0 && S_ISREG(info.st_mode) && access(path.c_str(), X_OK) == 0;
}

// Path of a program, by the rules of execvp.
absl::StatusOr<std::string> ResolveProgram(const std::string& name,
                                           const std::vector<std::string>& env) {
  std::vector<std::string> candidates;
  if (name.find('/') != std::string::npos) {
    candidates.push_back(name);
  } else {
    std::string path;
    for (const std::string& entry : env) {
      if (entry.rfind("PATH=", 0) == 0) path = entry.substr(5);
    }
    for (const auto& dir : absl::StrSplit(path, ':')) {
      if (!dir.empty()) candidates.push_back(absl::StrCat(dir, "/", name));
    }
  }
  for (const std::string& candidate : candidates) {
    if (IsProgram(candidate)) return candidate;
  }
  return MakeError(absl::StatusCode::kFailedPrecondition, "PROGRAM_NOT_FOUND", name,
                   absl::StrCat("program \"", name,
                                "\" was not found or is not executable; install it, or give its "
                                "full path"));
}

// All that the child needs, made before fork: between fork and exec it may call only
// async-signal-safe functions, because other threads may have held locks.
struct ExecPlan {
  std::string path;
  std::vector<std::string> args, env;
  std::vector<char*> argv, envp;
  int input_fd;
  std::optional<SyscallFilter> filter;
  std::optional<FileRuleset> files;
  int niceness;
  int fd_limit;
  pid_t parent;

  static std::vector<char*> Pointers(std::vector<std::string>& strings) {
    std::vector<char*> pointers;
    for (std::string& s : strings) pointers.push_back(s.data());
    pointers.push_back(nullptr);
    return pointers;
  }
};

FileAccess MayOpen(const std::string& program, const std::vector<std::string>& env,
                   const FileAccess& more) {
  FileAccess access = AccessToRun(program, env);
  access.read.insert(access.read.end(), more.read.begin(), more.read.end());
  access.change.insert(access.change.end(), more.change.begin(), more.change.end());
  return access;
}

absl::StatusOr<ExecPlan> MakePlan(const SubprocessOptions& options) {
  ExecPlan plan;
  plan.args = options.args;
  plan.env = ChildEnvironment(options.env);
  LITAGS_ASSIGN_OR_RETURN(plan.path, ResolveProgram(options.args[0], plan.env));
  plan.argv = ExecPlan::Pointers(plan.args);
  plan.envp = ExecPlan::Pointers(plan.env);
  plan.input_fd = options.input_fd;
  if (options.confined) {
    plan.filter = SyscallFilter::ForProgram(Sockets::kNone);
    plan.files.emplace(MayOpen(plan.path, plan.env, options.files));
  }
  plan.niceness = options.niceness;
  plan.fd_limit = static_cast<int>(std::clamp<long>(sysconf(_SC_OPEN_MAX), 256, 65536));
  plan.parent = getpid();
  return plan;
}

// Makes `fd` the child's stdin, or leaves it there, open when the program starts.
bool BecomeStdin(int fd) {
  return fd == STDIN_FILENO ? fcntl(fd, F_SETFD, 0) == 0 : dup2(fd, STDIN_FILENO) >= 0;
}

void CloseOnExecFrom(int first, int fd_limit) {
  if (close_range(first, ~0u, CLOSE_RANGE_CLOEXEC) == 0) return;
  for (int fd = first; fd < fd_limit; ++fd) fcntl(fd, F_SETFD, FD_CLOEXEC);  // kernels before 5.11
}

// The child's side. Reports errno of the step that failed through error_fd (close-on-exec, so a
// successful exec closes it silently).
[[noreturn]] void ExecChild(const ExecPlan& plan, int output_fd, int error_fd) {
  const auto fail = [error_fd] {
    const int error = errno;
    [[maybe_unused]] const ssize_t n = write(error_fd, &error, sizeof(error));
    _exit(127);
  };
  setpgid(0, 0);
  if (prctl(PR_SET_PDEATHSIG, SIGKILL) != 0) fail();
  if (getppid() != plan.parent) _exit(127);  // the parent died before the line above

  // Handlers and ignored signals of ours are none of the child's business; the mask was filled
  // before fork so that no handler of ours ran here.
  struct sigaction default_action = {};
  default_action.sa_handler = SIG_DFL;
  for (int s = 1; s < NSIG; ++s) sigaction(s, &default_action, nullptr);
  sigset_t none;
  sigemptyset(&none);
  sigprocmask(SIG_SETMASK, &none, nullptr);

  const int input_fd = plan.input_fd >= 0 ? plan.input_fd : open("/dev/null", O_RDONLY);
  if (input_fd < 0 || !BecomeStdin(input_fd)) fail();
  if (dup2(output_fd, 1) < 0 || dup2(output_fd, 2) < 0) fail();
  CloseOnExecFrom(3, plan.fd_limit);

  if (plan.niceness > 0) {
    errno = 0;
    if (nice(plan.niceness) == -1 && errno != 0) fail();
  }
  // A kernel that has none of this is no reason to run nothing.
  if (plan.files) {
    errno = plan.files->Apply();
    if (errno != 0 && errno != ENOSYS) fail();
  }
  if (plan.filter) {
    KeepFilePowersOnly();
    plan.filter->Apply();
  }
  execve(plan.path.c_str(), plan.argv.data(), plan.envp.data());
  fail();
  _exit(127);
}

// Forks and waits until the child has become the program.
absl::StatusOr<pid_t> Start(const ExecPlan& plan, int output_fd) {
  LITAGS_ASSIGN_OR_RETURN(Pipe errors, MakePipe());
  sigset_t all, previous;
  sigfillset(&all);
  pthread_sigmask(SIG_SETMASK, &all, &previous);
  const pid_t pid = fork();
  const int fork_error = errno;
  if (pid == 0) ExecChild(plan, output_fd, errors.write.get());
  pthread_sigmask(SIG_SETMASK, &previous, nullptr);
  if (pid < 0) return SystemError("fork", fork_error);

  errors.write.Close();
  int child_error = 0;
  ssize_t n;
  do {
    n = read(errors.read.get(), &child_error, sizeof(child_error));
  } while (n < 0 && errno == EINTR);
  if (n == sizeof(child_error)) {
    waitpid(pid, nullptr, 0);
    return MakeError(absl::StatusCode::kFailedPrecondition, "PROGRAM_NOT_STARTED", plan.args[0],
                     absl::StrCat("program \"", plan.path, "\" could not be started: ",
                                  strerror(child_error), "; check the program and its limits"));
  }
  return pid;
}

// The child's output: to the log, to the callback line by line, and the last lines kept.
class Output {
 public:
  explicit Output(const SubprocessOptions& options) : options_(options) {}

  absl::Status Open() {
    if (options_.log_path.empty()) return absl::OkStatus();
    log_ =
        UniqueFd(open(options_.log_path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644));
    if (log_.valid()) return absl::OkStatus();
    return MakeError(absl::StatusCode::kFailedPrecondition, "LOG_NOT_WRITABLE", "log_path",
                     absl::StrCat("cannot write log \"", options_.log_path, "\": ", strerror(errno),
                                  "; check the folder"));
  }

  void Add(std::string_view bytes) {
    Log(bytes);
    for (const char c : bytes) {
      if (c != '\n' && c != '\r') line_.push_back(c);
      if (c == '\n' || c == '\r' || line_.size() >= kMaxLineBytes) EndLine();
    }
  }

  void Finish() { EndLine(); }
  std::string Tail() const { return absl::StrJoin(tail_, "\n"); }

 private:
  // Up to the limit, or until the disk is full.
  void Log(std::string_view bytes) {
    bytes = bytes.substr(0, kMaxLogBytes - logged_);
    while (log_.valid() && !bytes.empty()) {
      const ssize_t n = write(log_.get(), bytes.data(), bytes.size());
      if (n < 0 && errno == EINTR) continue;
      if (n <= 0) {
        log_.Close();
        return;
      }
      bytes.remove_prefix(n);
      logged_ += n;
    }
  }

  void EndLine() {
    if (line_.empty()) return;
    if (options_.on_line) options_.on_line(line_);
    tail_.push_back(std::move(line_));
    line_.clear();
    if (tail_.size() > options_.tail_lines) tail_.pop_front();
  }

  const SubprocessOptions& options_;
  UniqueFd log_;
  int64_t logged_ = 0;
  std::string line_;
  std::deque<std::string> tail_;
};

// Waits for output, at most kPollMs, and hands on what there is. False at end of file.
bool Pump(int fd, Output& output) {
  pollfd p = {fd, POLLIN, 0};
  if (poll(&p, 1, kPollMs) <= 0) return true;
  char buffer[16384];
  const ssize_t n = read(fd, buffer, sizeof(buffer));
  if (n > 0) output.Add({buffer, static_cast<size_t>(n)});
  return n > 0 || (n < 0 && (errno == EAGAIN || errno == EINTR));
}

// Whether the program ended; its process stays a zombie, so its group id cannot be reused yet.
absl::StatusOr<bool> HasEnded(pid_t pid) {
  siginfo_t info = {};
  if (waitid(P_PID, pid, &info, WEXITED | WNOHANG | WNOWAIT) == 0) return info.si_pid == pid;
  if (errno == EINTR) return false;
  return absl::InternalError(absl::StrCat("waiting for a child program failed: ", strerror(errno),
                                          "; something else in this process reaps children"));
}

// Whether a program brings this signal upon itself; others are sent to it.
bool IsOwnFault(int signal) {
  switch (signal) {
    case SIGABRT:
    case SIGSEGV:
    case SIGBUS:
    case SIGFPE:
    case SIGILL:
    case SIGTRAP:
    case SIGSYS:
      return true;
    default:
      return false;
  }
}

// Follows the child to its end; asks it to stop, then forces it, once `stop` becomes an error.
absl::Status Follow(pid_t pid, int fd, const SubprocessOptions& options, const CancelToken& cancel,
                    Clock::time_point start, Output& output) {
  absl::Status stop;
  bool open = true;
  double kill_at = 0;
  while (true) {
    if (open) {
      open = Pump(fd, output);
    } else {
      poll(nullptr, 0, kPollMs);
    }
    LITAGS_ASSIGN_OR_RETURN(const bool ended, HasEnded(pid));
    if (ended) break;
    const double now = Seconds(Clock::now() - start);
    if (!stop.ok()) {
      if (now >= kill_at) killpg(pid, SIGKILL);
      continue;
    }
    stop = cancel.Check();
    if (stop.ok() && options.timeout_seconds > 0 && now >= options.timeout_seconds) {
      stop = MakeError(absl::StatusCode::kDeadlineExceeded, "PROGRAM_TIMEOUT", options.args[0],
                       absl::StrCat("program \"", options.args[0], "\" did not end within ",
                                    options.timeout_seconds, " s; allow more time"));
    }
    if (!stop.ok()) {
      killpg(pid, SIGTERM);
      kill_at = now + options.grace_seconds;
    }
  }
  killpg(pid, SIGKILL);  // what the program may have left in its group
  // What is still in the pipe, once around: a process that left the group may hold it open.
  fcntl(fd, F_SETFL, O_NONBLOCK);
  char buffer[65536];
  const ssize_t n = read(fd, buffer, sizeof(buffer));
  if (n > 0) output.Add({buffer, static_cast<size_t>(n)});
  output.Finish();
  return stop;
}

}  // namespace

absl::Status SubprocessOptions::Validate() const {
  const auto has_nul = [](const std::string& s) { return s.find('\0') != std::string::npos; };
  if (args.empty() || args[0].empty()) {
    return InvalidInput("ARGUMENT_MISSING", "args", "args is empty; name the program to run");
  }
  if (std::any_of(args.begin(), args.end(), has_nul) ||
      std::any_of(env.begin(), env.end(), has_nul)) {
    return InvalidInput("BAD_ARGUMENT", "args", "an argument holds a NUL byte; remove it");
  }
  for (const std::string& entry : env) {
    if (entry.find('=') == std::string::npos || entry[0] == '=') {
      return InvalidInput("BAD_ARGUMENT", "env",
                          absl::StrCat("env \"", entry, "\" is not of the form NAME=value"));
    }
  }
  if (!(timeout_seconds >= 0) || !(grace_seconds >= 0)) {
    return InvalidInput("OUT_OF_RANGE", "timeout_seconds",
                        "times must be 0 or more; a timeout of 0 means no limit");
  }
  if (niceness < 0 || niceness > 19) {
    return InvalidInput("OUT_OF_RANGE", "niceness",
                        absl::StrCat("niceness ", niceness, " is outside 0..19"));
  }
  return absl::OkStatus();
}

absl::StatusOr<SubprocessResult> RunSubprocess(const SubprocessOptions& options,
                                               const CancelToken& cancel) {
  LITAGS_RETURN_IF_ERROR(options.Validate());
  LITAGS_RETURN_IF_ERROR(cancel.Check());
  LITAGS_ASSIGN_OR_RETURN(const ExecPlan plan, MakePlan(options));
  Output output(options);
  LITAGS_RETURN_IF_ERROR(output.Open());
  LITAGS_ASSIGN_OR_RETURN(Pipe pipe, MakePipe());

  const Clock::time_point start = Clock::now();
  LITAGS_ASSIGN_OR_RETURN(const pid_t pid, Start(plan, pipe.write.get()));
  pipe.write.Close();
  const absl::Status followed = Follow(pid, pipe.read.get(), options, cancel, start, output);
  int status = 0;
  while (waitpid(pid, &status, 0) < 0 && errno == EINTR) {
  }
  LITAGS_RETURN_IF_ERROR(followed);

  if (WIFSIGNALED(status)) {
    const int signal = WTERMSIG(status);
    return MakeError(absl::StatusCode::kInternal,
                     IsOwnFault(signal) ? "PROGRAM_CRASHED" : "PROGRAM_KILLED", options.args[0],
                     absl::StrCat("program \"", options.args[0], "\" was ended by signal ", signal,
                                  " (", strsignal(signal), ")",
                                  signal == SIGKILL ? ", perhaps for want of memory" : "",
                                  "; its last output: ", output.Tail()));
  }
  SubprocessResult result;
  result.exit_code = WEXITSTATUS(status);
  result.seconds = Seconds(Clock::now() - start);
  result.tail = output.Tail();
  return result;
}

}  // namespace litags
