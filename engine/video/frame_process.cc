#include "engine/video/frame_process.h"

#include <fcntl.h>
#include <signal.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <new>
#include <opencv2/core/utility.hpp>

#include "absl/strings/ascii.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_split.h"
#include "engine/core/error.h"
#include "engine/core/limits.h"
#include "engine/core/sandbox.h"
#include "engine/core/subprocess.h"
#include "engine/core/unique_fd.h"
#include "engine/core/utf8.h"
#include "engine/io/file_util.h"
#include "engine/video/video_file.h"

namespace litags {
namespace {

// What a video may cost. An hour of a slow processor is what 20 minutes of 4K take.
constexpr int64_t kMemoryBytes = int64_t{3} << 30;
constexpr int kProcessorSeconds = 2 * 3600;
constexpr size_t kMaxMessageBytes = 2048;

// A line of the process's output: what it is, and the rest.
//   progress TEXT    frame BYTES    error CODE REASON MESSAGE
//   done FRAMES CHOSEN SECONDS WHOLE DAMAGED
// The bytes of frames go to the file that is its stdin, one after the other.
constexpr absl::string_view kProgress = "progress", kFrame = "frame", kDone = "done",
                            kError = "error";

void Say(const std::string& line) {
  const std::string text = line.substr(0, kMaxMessageBytes) + "\n";
  [[maybe_unused]] const ssize_t n = write(STDOUT_FILENO, text.data(), text.size());
}

// Messages hold the video's name, and a line with control characters is not heard.
std::string WithoutControls(std::string_view text) {
  std::string shown;
  while (!text.empty()) {
    const size_t control = ControlLength(text);
    shown += control > 0 ? ' ' : text[0];
    text.remove_prefix(std::max<size_t>(control, 1));
  }
  return shown;
}

std::string ErrorLine(const absl::Status& status) {
  const ErrorDetail detail = GetErrorDetail(status).value_or(ErrorDetail{});
  return absl::StrCat(kError, " ", status.raw_code(), " ",
                      detail.reason.empty() ? "VIDEO_CORRUPT" : detail.reason, " ",
                      WithoutControls(std::string(status.message())));
}

[[noreturn]] void EndWith(const std::string& line) {
  Say(line);
  _exit(0);
}

// What handlers say, which may not allocate.
std::string no_memory_line, no_time_line;

[[noreturn]] void EndFromHandler(const std::string& line) {
  [[maybe_unused]] const ssize_t n = write(STDOUT_FILENO, line.data(), line.size());
  _exit(0);
}

// A file's bytes, as long as this lives.
class MappedFile {
 public:
  static absl::StatusOr<MappedFile> Open(const std::string& path, const std::string& field) {
    const UniqueFd file(open(path.c_str(), O_RDONLY | O_CLOEXEC));
    struct stat info = {};
    if (!file.valid() || fstat(file.get(), &info) != 0) {
      return MakeError(errno == ENOENT ? absl::StatusCode::kNotFound : absl::StatusCode::kInternal,
                       "IO_ERROR", field,
                       absl::StrCat(field, ": cannot be opened: ", strerror(errno)));
    }
    if (info.st_size == 0) {
      return InvalidInput("FILE_EMPTY", field,
                          absl::StrCat(field,
                                       ": the file has no bytes; copy it from the camera "
                                       "again"));
    }
    const auto size = static_cast<size_t>(info.st_size);
    void* bytes = mmap(nullptr, size, PROT_READ, MAP_PRIVATE, file.get(), 0);
    if (bytes == MAP_FAILED) {
      return MakeError(absl::StatusCode::kResourceExhausted, "VIDEO_TOO_COSTLY", field,
                       absl::StrCat(field, ": its ", size,
                                    " bytes do not fit the memory that may "
                                    "be used (",
                                    strerror(errno), "); make it shorter or smaller"));
    }
    return MappedFile(static_cast<const char*>(bytes), size);
  }
  MappedFile(MappedFile&& other) noexcept : bytes_(std::exchange(other.bytes_, {})) {}
  MappedFile& operator=(MappedFile&&) = delete;
  ~MappedFile() {
    if (!bytes_.empty()) munmap(const_cast<char*>(bytes_.data()), bytes_.size());
  }
  std::string_view bytes() const { return bytes_; }
  // What was read of it no longer counts as memory of ours; the bytes stay what they are.
  void LeaveMemory() const {
    madvise(const_cast<char*>(bytes_.data()), bytes_.size(), MADV_DONTNEED);
  }

 private:
  MappedFile(const char* bytes, size_t size) : bytes_(bytes, size) {}
  std::string_view bytes_;
};

absl::Status WriteAll(int fd, const std::string& bytes, const std::string& field) {
  for (size_t at = 0; at < bytes.size();) {
    const ssize_t n = write(fd, bytes.data() + at, bytes.size() - at);
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) {
      return MakeError(absl::StatusCode::kResourceExhausted, "DISK_FULL", field,
                       absl::StrCat(field,
                                    ": there is no room for its frames; free some, or ask "
                                    "for fewer with --frames"));
    }
    at += static_cast<size_t>(n);
  }
  return absl::OkStatus();
}

// The process's side.
int PickFramesMain(const std::string& path, const std::string& field, int most) {
  const auto file = MappedFile::Open(path, field);
  if (!file.ok()) EndWith(ErrorLine(file.status()));
  cv::setNumThreads(1);
  no_memory_line = ErrorLine(VideoTooCostly(field, "memory")) + "\n";
  no_time_line = ErrorLine(VideoTooCostly(field, "time")) + "\n";
  std::set_new_handler([] { EndFromHandler(no_memory_line); });
  signal(SIGXCPU, [](int) { EndFromHandler(no_time_line); });
  signal(SIGXFSZ, SIG_IGN);  // write() says so
  // What decoders say about a file could fill the log.
  const int null_fd = open("/dev/null", O_WRONLY);
  dup2(null_fd, STDERR_FILENO);
  LimitResource(RLIMIT_CORE, 0);
  LimitResource(RLIMIT_FSIZE, kMaxJobBytes);
  if (!kBuiltWithSanitizer) LimitResource(RLIMIT_DATA, kMemoryBytes);
  LimitResource(RLIMIT_CPU, kProcessorSeconds, 2);
  SyscallFilter::ForComputing().Apply();

  const auto picked = PickFrames(
      file->bytes(), field, most,
      [&](const std::string& text) {
        file->LeaveMemory();
        Say(absl::StrCat(kProgress, " ", text));
      },
      [&](const std::string& png) {
        file->LeaveMemory();
        LITAGS_RETURN_IF_ERROR(WriteAll(STDIN_FILENO, png, field));
        Say(absl::StrCat(kFrame, " ", png.size()));
        return absl::OkStatus();
      });
  if (!picked.ok()) EndWith(ErrorLine(picked.status()));
  EndWith(absl::StrFormat("%s %d %d %.3f %.3f %d", kDone, picked->frames, picked->chosen,
                          picked->seconds, picked->whole_seconds, picked->damaged));
}

// Numbers the frames and writes them.
class FrameWriter {
 public:
  explicit FrameWriter(std::string dir) : dir_(std::move(dir)) {}
  absl::Status Write(std::string_view png) {
    return WriteFileAtomically(absl::StrFormat("%s/frame_%04d.png", dir_, ++count_), png);
  }

 private:
  const std::string dir_;
  int count_ = 0;
};

// A file without a name, for the frames on their way.
absl::StatusOr<UniqueFd> MakePipeFile(const std::string& dir, const std::string& field) {
  std::string pattern = dir + "/.frames-XXXXXX";
  UniqueFd fd(mkostemp(pattern.data(), O_CLOEXEC));
  if (!fd.valid()) {
    return MakeError(absl::StatusCode::kInternal, "IO_ERROR", field,
                     absl::StrCat("cannot make a file in ", dir, ": ", strerror(errno)));
  }
  unlink(pattern.c_str());
  return fd;
}

// What the process says, believed as far as it can do no harm.
class Listener {
 public:
  Listener(const std::string& dir, std::string field, int frames_fd, const FrameProgress& progress)
      : writer_(dir), field_(std::move(field)), frames_fd_(frames_fd), progress_(progress) {}

  void Hear(std::string_view said) {
    if (!status_.ok() || HoldsControl(said)) return;
    const std::string line = Utf8Prefix(said, kMaxMessageBytes);
    const std::vector<std::string> words = absl::StrSplit(line, absl::MaxSplits(' ', 3));
    if (words[0] == kProgress && words.size() > 1) {
      if (progress_) progress_(line.substr(kProgress.size() + 1));
    } else if (words[0] == kFrame && words.size() == 2) {
      status_ = Take(words[1]);
    } else if (words[0] == kError && words.size() == 4) {
      status_ = HearError(words);
    } else if (words[0] == kDone && words.size() == 4) {
      HearDone(words);
    }
  }

  absl::StatusOr<PickedFrames> Result() const {
    LITAGS_RETURN_IF_ERROR(status_);
    if (done_) return picked_;
    return InvalidInput("VIDEO_CORRUPT", field_,
                        absl::StrCat(field_,
                                     ": the process that read it ended without an answer; "
                                     "save the video anew with another program"));
  }

 private:
  absl::Status Take(const std::string& size) {
    int64_t bytes = 0;
    if (!absl::SimpleAtoi(size, &bytes) || bytes <= 0 || bytes > kMaxImageBytes ||
        ++frames_ > kMaxFramesTaken) {
      return InvalidInput("VIDEO_CORRUPT", field_, absl::StrCat(field_, ": gave no frames"));
    }
    std::string png(static_cast<size_t>(bytes), '\0');
    for (size_t at = 0; at < png.size();) {
      const ssize_t n = pread(frames_fd_, png.data() + at, png.size() - at,
                              static_cast<off_t>(taken_ + static_cast<int64_t>(at)));
      if (n < 0 && errno == EINTR) continue;
      if (n <= 0) {
        return InvalidInput("VIDEO_CORRUPT", field_, absl::StrCat(field_, ": gave no frames"));
      }
      at += static_cast<size_t>(n);
    }
    // The room is free again where the file system can do that.
    fallocate(frames_fd_, FALLOC_FL_PUNCH_HOLE | FALLOC_FL_KEEP_SIZE, taken_, bytes);
    taken_ += bytes;
    return writer_.Write(png);
  }

  absl::Status HearError(const std::vector<std::string>& words) const {
    const bool is_reason = !words[2].empty() && words[2].size() <= kMaxReasonBytes &&
                           std::all_of(words[2].begin(), words[2].end(), [](char c) {
                             return absl::ascii_isupper(c) || absl::ascii_isdigit(c) || c == '_';
                           });
    int code = 0;
    const bool known =
        absl::SimpleAtoi(words[1], &code) &&
        (code == int(absl::StatusCode::kResourceExhausted) ||
         code == int(absl::StatusCode::kNotFound) || code == int(absl::StatusCode::kInternal));
    return MakeError(
        known ? static_cast<absl::StatusCode>(code) : absl::StatusCode::kInvalidArgument,
        is_reason ? words[2] : "VIDEO_CORRUPT", field_, words[3]);
  }

  void HearDone(const std::vector<std::string>& words) {
    const std::vector<std::string> more = absl::StrSplit(words[3], ' ');
    done_ = more.size() == 3 && absl::SimpleAtoi(words[1], &picked_.frames) &&
            absl::SimpleAtoi(words[2], &picked_.chosen) &&
            absl::SimpleAtod(more[0], &picked_.seconds) &&
            absl::SimpleAtod(more[1], &picked_.whole_seconds) &&
            absl::SimpleAtoi(more[2], &picked_.damaged);
  }

  static constexpr size_t kMaxReasonBytes = 64;
  static constexpr int kMaxFramesTaken = 100'000;
  FrameWriter writer_;
  const std::string field_;
  const int frames_fd_;
  const FrameProgress& progress_;
  int frames_ = 0;
  int64_t taken_ = 0;
  PickedFrames picked_;
  bool done_ = false;
  absl::Status status_;
};

absl::StatusOr<PickedFrames> PickHere(const std::string& dir, const std::string& path,
                                      const std::string& field, int most,
                                      const FrameProgress& progress, const CancelToken& cancel) {
  LITAGS_ASSIGN_OR_RETURN(const MappedFile file, MappedFile::Open(path, field));
  FrameWriter writer(dir);
  return PickFrames(
      file.bytes(), field, most, progress,
      [&](const std::string& png) { return writer.Write(png); }, cancel);
}

}  // namespace

std::optional<int> MaybePickFrames(int argc, char** argv) {
  int most = 0;
  if (argc != 5 || std::string_view(argv[1]) != kPickFramesCommand ||
      !absl::SimpleAtoi(argv[4], &most)) {
    return std::nullopt;
  }
  return PickFramesMain(argv[2], argv[3], most);
}

std::vector<std::string> OwnPickFramesProgram() { return {"/proc/self/exe", kPickFramesCommand}; }

absl::StatusOr<PickedFrames> PickFramesInto(const std::string& dir, const std::string& path,
                                            const std::string& field, int most,
                                            const std::vector<std::string>& program,
                                            const FrameProgress& progress,
                                            const CancelToken& cancel) {
  if (program.empty()) return PickHere(dir, path, field, most, progress, cancel);
  LITAGS_ASSIGN_OR_RETURN(const UniqueFd frames, MakePipeFile(dir, field));
  Listener listener(dir, field, frames.get(), progress);
  SubprocessOptions child;
  child.args = program;
  child.args.insert(child.args.end(), {path, field, absl::StrCat(most)});
  child.env = {"OMP_NUM_THREADS=1", "OPENBLAS_NUM_THREADS=1", "OPENCV_FOR_THREADS_NUM=1"};
  child.input_fd = frames.get();
  child.confined = true;
  child.files.read = {path};
  child.grace_seconds = 0;  // it has nothing to put in order
  child.on_line = [&](std::string_view line) { listener.Hear(line); };
  const auto result = RunSubprocess(child, cancel);
  const auto reason = GetErrorDetail(result.status());
  if (reason.has_value() && reason->reason == "PROGRAM_CRASHED") {
    return InvalidInput("VIDEO_CORRUPT", field,
                        absl::StrCat(field,
                                     ": the process that read it crashed; save the video "
                                     "anew with another program"));
  }
  LITAGS_RETURN_IF_ERROR(result.status());
  return listener.Result();
}

}  // namespace litags
