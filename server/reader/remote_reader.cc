#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <spdlog/spdlog.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <chrono>
#include <condition_variable>
#include <cstring>
#include <memory>
#include <mutex>
#include <optional>
#include <thread>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "engine/core/subprocess.h"
#include "server/reader/answers.h"
#include "server/reader/channel.h"
#include "server/reader/file_reader.h"

namespace litags {
namespace {

using SteadyClock = std::chrono::steady_clock;

constexpr int kLookMs = 100;  // how often cancellation is looked at; packets wake us at once
// A process that says nothing for so long is given up: its time on a processor is limited, but not
// its sleep.
constexpr std::chrono::seconds kMaxSilence{600};
constexpr std::chrono::seconds kMaxStart{20};
constexpr double kMinLifeSeconds = 1;  // between two starts of the program
// How long it may take us to learn that the program ended; see kPollMs of RunSubprocess().
constexpr std::chrono::milliseconds kNewsOfEnd{1000};

absl::Status Unavailable(const std::string& field) {
  return MakeError(absl::StatusCode::kUnavailable, "FILE_CHECK_UNAVAILABLE", field,
                   absl::StrCat(field,
                                ": the server cannot start a process to read it; what came "
                                "of it is kept, try again in a moment"));
}

// OK once a packet, or the other side's end, is there. CANCELLED, DEADLINE_EXCEEDED.
absl::Status Await(const Channel& channel, SteadyClock::time_point end, const CancelToken& cancel) {
  for (pollfd p = {channel.fd(), POLLIN, 0};;) {
    LITAGS_RETURN_IF_ERROR(cancel.Check());
    if (poll(&p, 1, kLookMs) > 0) return absl::OkStatus();
    if (SteadyClock::now() > end) return absl::DeadlineExceededError("no packet came");
  }
}

// The talk with the process of one file, which ends with it.
class Conversation {
 public:
  Conversation(Channel channel, UniqueFd process, int64_t program)
      : channel_(std::move(channel)), process_(std::move(process)), program_(program) {}
  Conversation(Conversation&&) = default;
  ~Conversation() {
    if (process_.valid()) syscall(SYS_pidfd_send_signal, process_.get(), SIGKILL, nullptr, 0);
  }

  // Of the program that made the process.
  int64_t program() const { return program_; }

  bool Send(char kind) { return channel_.Send(std::string_view(&kind, 1)); }

  // The next packet. CANCELLED; INVALID_ARGUMENT if none comes; nullopt if the process has ended.
  absl::StatusOr<std::optional<std::string>> Receive(const std::string& field,
                                                     const CancelToken& cancel) {
    const absl::Status came = Await(channel_, SteadyClock::now() + kMaxSilence, cancel);
    if (absl::IsDeadlineExceeded(came)) return CheckFailed(field, "did not come to an end");
    LITAGS_RETURN_IF_ERROR(came);
    return channel_.Receive();
  }

 private:
  Channel channel_;
  UniqueFd process_;
  int64_t program_;
};

class RemoteReader : public FileReader {
 public:
  RemoteReader(std::vector<std::string> command, ReaderLimits limits)
      : command_(std::move(command)), limits_(limits) {}

  ~RemoteReader() override {
    stop_.Cancel();
    if (thread_.joinable()) thread_.join();
  }

  absl::Status Check(const std::string& path, const std::string& field, FileRecord* file,
                     const CancelToken& cancel) override {
    const std::string request = MakePacket(
        packet::kCheck, {field, file->name, absl::StrCat(static_cast<int>(file->role)),
                         absl::StrCat(limits_.memory_bytes), absl::StrCat(limits_.file_seconds)});
    // Twice: someone else may have killed the first process, for want of memory perhaps.
    for (int attempt = 0; attempt < 2; ++attempt) {
      LITAGS_ASSIGN_OR_RETURN(Conversation conversation, Begin(request, path, field, cancel));
      LITAGS_ASSIGN_OR_RETURN(const auto packet, conversation.Receive(field, cancel));
      if (packet) return ParseVerdict(*packet, field, file);
      spdlog::warn("a process that read {} ended without an answer", ShownName(field));
    }
    return CheckFailed(field, "crashed");
  }

  absl::StatusOr<std::unique_ptr<ArchiveReader>> OpenArchive(const std::string& path,
                                                             const ArchiveLimits& limits,
                                                             const std::string& field,
                                                             ArchiveSink* sink,
                                                             const CancelToken& cancel) override {
    const std::string request = MakePacket(
        packet::kUnpack,
        {field, "", "0", absl::StrCat(limits_.memory_bytes), absl::StrCat(limits_.archive_seconds),
         absl::StrCat(limits.max_entries), absl::StrCat(limits.max_entry_bytes),
         absl::StrCat(limits.max_total_bytes), absl::StrCat(limits.max_ratio)});
    LITAGS_ASSIGN_OR_RETURN(Conversation conversation, Begin(request, path, field, cancel));
    return std::make_unique<Archive>(this, std::move(conversation), limits, field, sink, cancel);
  }

 private:
  // An archive that a process unpacks, which waits between two files.
  class Archive : public ArchiveReader {
   public:
    Archive(RemoteReader* reader, Conversation conversation, const ArchiveLimits& limits,
            std::string field, ArchiveSink* sink, CancelToken cancel)
        : reader_(reader),
          conversation_(std::move(conversation)),
          limits_(limits),
          field_(std::move(field)),
          cancel_(std::move(cancel)),
          receiver_(limits_, field_, sink) {}

    absl::StatusOr<bool> ReadNext() override {
      for (;;) {
        LITAGS_ASSIGN_OR_RETURN(const auto packet, conversation_.Receive(field_, cancel_));
        if (!packet) break;
        if (packet->front() == packet::kVerdict) {
          FileRecord unused;
          LITAGS_RETURN_IF_ERROR(ParseVerdict(*packet, field_, &unused));
          return false;
        }
        LITAGS_ASSIGN_OR_RETURN(const char answer, receiver_.Take(*packet));
        if (answer != 0) conversation_.Send(answer);
        if (answer == packet::kNotWanted || packet->front() == packet::kEndOfEntry) return true;
      }
      spdlog::warn("a process that unpacked {} ended without an answer", ShownName(field_));
      return reader_->HasEnded(conversation_.program()) ? Unavailable(field_)
                                                        : CheckFailed(field_, "crashed");
    }

   private:
    RemoteReader* const reader_;
    Conversation conversation_;
    const ArchiveLimits limits_;
    const std::string field_;
    const CancelToken cancel_;
    EntryReceiver receiver_;
  };

  // Has the program make a process for the file at `path`.
  absl::StatusOr<Conversation> Begin(const std::string& request, const std::string& path,
                                     const std::string& field, const CancelToken& cancel) {
    if (request.size() > kMaxPacketBytes) return CheckFailed(field, "has too long a name");
    const UniqueFd file(open(path.c_str(), O_RDONLY | O_CLOEXEC));
    if (!file.valid()) {
      return MakeError(
          absl::StatusCode::kInternal, "IO_ERROR", field,
          absl::StrCat(field, ": the server cannot open what it stored: ", strerror(errno)));
    }
    for (const auto end = SteadyClock::now() + kMaxStart; SteadyClock::now() < end;) {
      LITAGS_RETURN_IF_ERROR(cancel.Check());
      int64_t program = 0;
      const auto control = Program(end, &program);
      if (!control) break;
      LITAGS_ASSIGN_OR_RETURN(auto ends, Channel::MakePair());
      if (control->Send(request, {ends.second.fd(), file.get()})) {
        ends.second = Channel();  // the process has it
        std::vector<UniqueFd> process;
        if (Await(ends.first, end, cancel).ok() && ends.first.Receive(&process)) {
          return Conversation(std::move(ends.first),
                              process.empty() ? UniqueFd() : std::move(process[0]), program);
        }
      }
      HasEnded(program);  // waits for the next one
    }
    return Unavailable(field);
  }

  // The way to the program that runs now, which is started first if need be.
  std::shared_ptr<Channel> Program(SteadyClock::time_point end, int64_t* number) {
    std::unique_lock lock(mutex_);
    if (!thread_.joinable()) thread_ = std::thread([this] { KeepRunning(); });
    changed_.wait_until(lock, end, [this] { return control_ != nullptr; });
    *number = program_;
    return control_;
  }

  bool HasEnded(int64_t program) {
    std::unique_lock lock(mutex_);
    return changed_.wait_for(lock, kNewsOfEnd,
                             [&] { return program_ != program || control_ == nullptr; });
  }

  void KeepRunning() {
    while (!stop_.IsCancelled()) {
      const auto start = SteadyClock::now();
      absl::Status ended;
      if (auto ends = Channel::MakePair(); ends.ok()) {
        ended = Run(std::move(ends->first), std::move(ends->second));
      } else {
        ended = ends.status();
      }
      if (stop_.IsCancelled()) return;
      spdlog::error("the program that reads uploaded files ended, and is started again: {}",
                    std::string(ended.message()));
      const std::chrono::duration<double> lived = SteadyClock::now() - start;
      stop_.SleepFor(kMinLifeSeconds - lived.count());
    }
  }

  // Until the program ends.
  absl::Status Run(Channel ours, Channel theirs) {
    SubprocessOptions child;
    child.args = command_;
    child.env = {"OMP_NUM_THREADS=1", "OPENBLAS_NUM_THREADS=1", "OPENCV_FOR_THREADS_NUM=1"};
    child.input_fd = theirs.fd();
    child.confined = true;
    child.grace_seconds = 0;  // it has nothing to put in order
    child.on_line = [](std::string_view line) { spdlog::warn("{}", line); };
    SetProgram(std::make_shared<Channel>(std::move(ours)));
    const auto result = RunSubprocess(child, stop_);
    SetProgram(nullptr);
    if (!result.ok()) return result.status();
    return absl::InternalError(absl::StrCat("exit code ", result->exit_code));
  }

  void SetProgram(std::shared_ptr<Channel> control) {
    std::lock_guard lock(mutex_);
    if (control) ++program_;
    control_ = std::move(control);
    changed_.notify_all();
  }

  const std::vector<std::string> command_;
  const ReaderLimits limits_;
  CancelToken stop_;
  std::mutex mutex_;
  std::condition_variable changed_;
  std::shared_ptr<Channel> control_;  // null: no program runs
  int64_t program_ = 0;               // counts programs
  std::thread thread_;
};

}  // namespace

std::unique_ptr<FileReader> MakeRemoteReader(std::vector<std::string> command,
                                             ReaderLimits limits) {
  return std::make_unique<RemoteReader>(std::move(command), limits);
}

}  // namespace litags
