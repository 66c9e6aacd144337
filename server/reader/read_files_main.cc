#include "server/reader/read_files_main.h"

#include <fcntl.h>
#include <signal.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <new>
#include <opencv2/core/utility.hpp>

#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "engine/core/sandbox.h"
#include "engine/core/utf8.h"
#include "engine/io/image_io.h"
#include "server/archive/extract.h"
#include "server/reader/channel.h"
#include "server/reader/content.h"

namespace litags {
namespace {

constexpr size_t kMaxMessageBytes = 4096;

// Of the file in hand, for handlers that may not allocate.
int answer_fd = -1;
std::string no_memory_answer, no_time_answer;

std::string Verdict(const absl::Status& status, const Content& content = {}) {
  const ErrorDetail detail = GetErrorDetail(status).value_or(ErrorDetail{});
  return MakePacket(
      packet::kVerdict,
      {absl::StrCat(status.raw_code()), detail.reason, Utf8Prefix(detail.field, kMaxMessageBytes),
       Utf8Prefix(std::string(status.message()), kMaxMessageBytes), absl::StrCat(content.width),
       absl::StrCat(content.height), content.about});
}

std::string Costly(const std::string& field, const char* what) {
  return Verdict(InvalidInput("FILE_CHECK_FAILED", field,
                              absl::StrCat(field, ": reading it takes more ", what,
                                           " than a file is given; leave it out, or save it "
                                           "anew")));
}

[[noreturn]] void EndWith(const std::string& answer) {
  [[maybe_unused]] const ssize_t n = write(answer_fd, answer.data(), answer.size());
  _exit(0);
}

void OnChildEnd(int) {
  const int error = errno;
  int status = 0;
  while (waitpid(-1, &status, WNOHANG) > 0) {
    if (!WIFSIGNALED(status) || WTERMSIG(status) == SIGKILL) continue;
    char text[] = "a process that read a file was ended by signal 00\n";
    text[sizeof(text) - 4] = static_cast<char>('0' + WTERMSIG(status) / 10 % 10);
    text[sizeof(text) - 3] = static_cast<char>('0' + WTERMSIG(status) % 10);
    [[maybe_unused]] const ssize_t n = write(STDERR_FILENO, text, sizeof(text) - 1);
  }
  errno = error;
}

void Handle(int signal, void (*handler)(int)) {
  struct sigaction action = {};
  action.sa_handler = handler;
  action.sa_flags = SA_RESTART;
  sigaction(signal, &action, nullptr);
}

// Hands what is unpacked to the server.
class SendingSink : public ArchiveSink {
 public:
  explicit SendingSink(const Channel* channel) : channel_(channel) {}

  absl::StatusOr<bool> Begin(const ArchiveEntry& entry) override {
    std::vector<std::string> names = entry.folders;
    names.push_back(entry.name);
    const std::string packet = MakePacket(packet::kEntry, names);
    if (packet.size() > kMaxPacketBytes) {
      return InvalidInput("ARCHIVE_ENTRY_UNSAFE", "", "an entry has an endless name");
    }
    Send(packet);
    const auto answer = channel_->Receive();
    if (!answer) _exit(0);  // the server has seen enough
    return answer->front() == packet::kWanted;
  }

  absl::Status Write(std::string_view bytes) override {
    for (size_t at = 0; at < bytes.size(); at += kMaxPacketBytes - 1) {
      std::string packet(1, packet::kBytes);
      Send(packet.append(bytes.substr(at, kMaxPacketBytes - 1)));
    }
    return absl::OkStatus();
  }

  absl::Status End() override {
    Send(std::string(1, packet::kEndOfEntry));
    return absl::OkStatus();
  }

 private:
  void Send(const std::string& packet) {
    if (!channel_->Send(packet)) _exit(0);
  }

  const Channel* const channel_;
};

// What the server asks for, as it wrote it.
struct Request {
  char kind = 0;
  std::string field, name;
  // Role, memory, seconds; an archive's limits.
  std::vector<int64_t> numbers = std::vector<int64_t>(7);

  static Request Parse(const std::string& packet) {
    Request request;
    request.kind = packet[0];
    const std::vector<std::string> texts = TextsOf(packet);
    request.field = texts[0];
    request.name = texts[1];
    for (size_t i = 2; i < texts.size() && i - 2 < request.numbers.size(); ++i) {
      (void)absl::SimpleAtoi(texts[i], &request.numbers[i - 2]);
    }
    return request;
  }
};

// The process of one file.
[[noreturn]] void ReadOne(const Request& request, const Channel& channel, const UniqueFd& file,
                          const SyscallFilter& filter, pid_t parent) {
  prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (getppid() != parent) _exit(0);
  // While this process can still be trusted, it says by what it can be ended.
  const UniqueFd self(static_cast<int>(syscall(SYS_pidfd_open, getpid(), 0)));
  const std::string hello(1, packet::kHello);
  if (!(self.valid() ? channel.Send(hello, {self.get()}) : channel.Send(hello))) _exit(0);

  answer_fd = channel.fd();
  no_memory_answer = Costly(request.field, "memory");
  no_time_answer = Costly(request.field, "time");
  std::set_new_handler([] { EndWith(no_memory_answer); });
  Handle(SIGCHLD, SIG_DFL);
  Handle(SIGXCPU, [](int) { EndWith(no_time_answer); });
  struct stat info = {};
  fstat(file.get(), &info);
  const auto size = static_cast<size_t>(info.st_size);
  void* const bytes = mmap(nullptr, size, PROT_READ, MAP_PRIVATE, file.get(), 0);
  if (bytes == MAP_FAILED) _exit(1);
  const std::string_view content(static_cast<const char*>(bytes), size);
  // What it says about a file is in its answer. A hostile one could fill the log.
  const int null_fd = open("/dev/null", O_WRONLY);
  dup2(null_fd, STDOUT_FILENO);
  if (!kBuiltWithSanitizer) dup2(null_fd, STDERR_FILENO);  // else for its reports
  LimitResource(RLIMIT_FSIZE, 0);
  if (!kBuiltWithSanitizer) LimitResource(RLIMIT_DATA, request.numbers[1]);
  LimitResource(RLIMIT_CPU, request.numbers[2], 2);
  filter.Apply();

  if (request.kind == packet::kUnpack) {
    ArchiveLimits limits;
    limits.max_entries = request.numbers[3];
    limits.max_entry_bytes = request.numbers[4];
    limits.max_total_bytes = request.numbers[5];
    limits.max_ratio = request.numbers[6];
    SendingSink sink(&channel);
    EndWith(Verdict(ExtractArchiveBytes(content, limits, request.field, &sink)));
  }
  const auto found =
      CheckContent(content, static_cast<FileRole>(request.numbers[0]), request.name, request.field);
  EndWith(Verdict(found.status(), found.value_or(Content{})));
}

// Whatever libraries load when they are first used; the processes cannot.
void LoadLibraries() {
  cv::setNumThreads(1);  // they cannot start threads either
  LoadPhotoDecoders();
  SendingSink unused(nullptr);
  const std::string empty_tar(1024, '\0');
  ExtractArchiveBytes(empty_tar, {}, "", &unused).IgnoreError();
}

}  // namespace

int ReadFilesMain() {
  const Channel control{UniqueFd(STDIN_FILENO)};
  LimitResource(RLIMIT_CORE, 0);  // it would hold photos
  LoadLibraries();
  const SyscallFilter filter = SyscallFilter::ForComputing();
  if (!SyscallFilter::Supported()) {
    std::fprintf(stderr,
                 "this kernel filters no system calls (seccomp): the processes that read "
                 "uploaded files have limits only\n");
  }
  Handle(SIGCHLD, OnChildEnd);
  const pid_t self = getpid();
  for (;;) {
    std::vector<UniqueFd> files;
    const auto packet = control.Receive(&files);
    if (!packet) return 0;
    if (files.size() != 2) continue;
    const Channel channel(std::move(files[0]));
    const UniqueFd file = std::move(files[1]);
    if (fork() == 0) {
      close(control.fd());
      ReadOne(Request::Parse(*packet), channel, file, filter, self);
    }
  }
}

}  // namespace litags
