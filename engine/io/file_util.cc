#include "engine/io/file_util.h"

#include <dirent.h>
#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <set>
#include <system_error>

#include "engine/core/name_key.h"
#include "engine/core/unique_fd.h"
#include "engine/core/utf8.h"
#include "engine/io/io_error.h"

namespace litags {
namespace {

absl::Status ErrnoStatus(int error, std::string_view field, const std::string& path,
                         std::string_view doing) {
  auto make = [&](absl::StatusCode code, std::string_view reason, std::string_view remedy) {
    // generic_category: strerror is not thread-safe.
    return FieldError(code, reason, field,
                      absl::StrCat("cannot ", Absl(doing), " '", path,
                                   "': ", std::generic_category().message(error), Absl(remedy)));
  };
  switch (error) {
    case ENOENT:
    case ENOTDIR:
      return make(absl::StatusCode::kNotFound, "NO_SUCH_FILE", "; check the path");
    case EACCES:
    case EPERM:
    case EROFS:
      return make(absl::StatusCode::kPermissionDenied, "NO_PERMISSION", "; check its permissions");
    case ENOSPC:
    case EDQUOT:
    case EFBIG:  // a limit on file sizes
      return make(absl::StatusCode::kResourceExhausted, "DISK_FULL", "; free some space");
    case ENAMETOOLONG:
      return make(absl::StatusCode::kInvalidArgument, "BAD_FILE_NAME", "; use a shorter name");
    default:
      return make(absl::StatusCode::kInternal, "IO_ERROR", "");
  }
}

std::string FolderOf(const std::string& path) {
  const size_t slash = path.rfind('/');
  if (slash == std::string::npos) return ".";
  return slash == 0 ? "/" : path.substr(0, slash);
}

// 0 or errno.
int WriteAll(int fd, absl::Span<const std::string_view> parts) {
  for (std::string_view bytes : parts) {
    while (!bytes.empty()) {
      const ssize_t n = ::write(fd, bytes.data(), bytes.size());
      if (n < 0 && errno == EINTR) continue;
      if (n < 0) return errno;
      bytes.remove_prefix(static_cast<size_t>(n));
    }
  }
  return 0;
}

// Whether it is there and neither a file nor a folder, but /dev/stdout or a FIFO, say.
bool IsDevice(const std::string& path) {
  struct stat info;
  return ::stat(path.c_str(), &info) == 0 && !S_ISREG(info.st_mode) && !S_ISDIR(info.st_mode);
}

// 0 or errno.
int WriteToDevice(const std::string& path, absl::Span<const std::string_view> parts) {
  UniqueFd fd(::open(path.c_str(), O_WRONLY | O_CLOEXEC));
  if (!fd.valid()) return errno;
  if (const int error = WriteAll(fd.get(), parts); error != 0) return error;
  return fd.Close() ? 0 : errno;
}

// Creates `path` with these bytes, on disk when it returns 0; otherwise errno.
int WriteNewFile(const std::string& path, absl::Span<const std::string_view> parts) {
  UniqueFd fd(::open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666));
  if (!fd.valid()) return errno;
  if (const int error = WriteAll(fd.get(), parts); error != 0) return error;
  if (::fsync(fd.get()) != 0) return errno;
  return fd.Close() ? 0 : errno;
}

}  // namespace

absl::StatusOr<std::string> ReadFile(const std::string& path, std::string_view field,
                                     int64_t max_bytes) {
  if (field.empty()) field = path;
  // O_NONBLOCK: opening a FIFO must not hang; it changes nothing for regular files.
  UniqueFd fd(::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK));
  struct stat info;
  if (!fd.valid() || ::fstat(fd.get(), &info) != 0) return ErrnoStatus(errno, field, path, "read");
  if (!S_ISREG(info.st_mode)) {
    return InvalidField("NOT_A_FILE", field, absl::StrCat("'", path, "' is not a regular file"));
  }
  if (info.st_size > max_bytes) {
    return InvalidField(
        "FILE_TOO_LARGE", field,
        absl::StrCat(static_cast<int64_t>(info.st_size), " bytes exceed the limit of ", max_bytes,
                     " bytes; send a smaller file"));
  }
  std::string bytes(static_cast<size_t>(info.st_size), '\0');
  size_t done = 0;
  while (done < bytes.size()) {
    const ssize_t n = ::read(fd.get(), bytes.data() + done, bytes.size() - done);
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) return ErrnoStatus(errno, field, path, "read");
    if (n == 0) break;  // shrunk meanwhile
    done += static_cast<size_t>(n);
  }
  bytes.resize(done);
  return bytes;
}

absl::Status WriteFileAtomically(const std::string& path, std::string_view bytes) {
  return WriteFileAtomically(path, absl::Span<const std::string_view>(&bytes, 1));
}

absl::Status WriteFileAtomically(const std::string& path,
                                 absl::Span<const std::string_view> parts) {
  if (IsDevice(path)) {
    const int error = WriteToDevice(path, parts);
    return error == 0 ? absl::OkStatus() : ErrnoStatus(error, path, path, "write");
  }
  static std::atomic<uint64_t> counter{0};
  const std::string folder = FolderOf(path);
  // Not derived from the target's name, which may already be as long as names can be.
  const std::string temp =
      absl::StrCat(folder, "/.", ::getpid(), "-", counter.fetch_add(1), kTempSuffix);
  int error = WriteNewFile(temp, parts);
  if (error == EEXIST) {  // left by a killed process that had our id
    ::unlink(temp.c_str());
    error = WriteNewFile(temp, parts);
  }
  if (error == 0 && ::rename(temp.c_str(), path.c_str()) != 0) error = errno;
  if (error != 0) {
    ::unlink(temp.c_str());
    return ErrnoStatus(error, path, path, "write");
  }
  UniqueFd dir(::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (!dir.valid() || ::fsync(dir.get()) != 0) return ErrnoStatus(errno, path, folder, "sync");
  return absl::OkStatus();
}

int RemoveStaleTempFiles(const std::string& dir) {
  std::unique_ptr<DIR, int (*)(DIR*)> handle(::opendir(dir.c_str()), ::closedir);
  if (handle == nullptr) return 0;
  int removed = 0;
  while (const dirent* entry = ::readdir(handle.get())) {
    if (!std::string_view(entry->d_name).ends_with(kTempSuffix)) continue;
    if (::unlinkat(::dirfd(handle.get()), entry->d_name, 0) == 0) ++removed;
  }
  return removed;
}

absl::StatusOr<std::vector<std::string>> ListNames(
    const std::string& dir, std::string_view field,
    absl::FunctionRef<bool(const std::filesystem::directory_entry& entry)> accept) {
  std::error_code error;
  std::filesystem::directory_iterator it(dir, error), end;
  if (error) {
    return FieldError(absl::StatusCode::kNotFound, "NO_SUCH_FOLDER", field,
                      absl::StrCat("cannot list the folder '", dir, "': ", error.message(),
                                   "; give a folder that is there"));
  }
  std::vector<std::string> names;
  for (; it != end; it.increment(error)) {
    if (accept(*it)) names.push_back(it->path().filename().string());
  }
  if (error) {
    return FieldError(absl::StatusCode::kInternal, "IO_ERROR", field,
                      absl::StrCat("cannot list the folder '", dir, "': ", error.message()));
  }
  std::sort(names.begin(), names.end());
  return names;
}

absl::StatusOr<std::vector<std::string>> ListFiles(
    const std::string& dir, std::string_view field,
    absl::FunctionRef<bool(const std::string& name)> accept) {
  return ListNames(dir, field, [&](const std::filesystem::directory_entry& entry) {
    std::error_code ignored;
    return accept(entry.path().filename().string()) && !entry.is_directory(ignored);
  });
}

absl::Status ValidateFileName(std::string_view name, std::string_view field) {
  constexpr size_t kMaxNameBytes = 255;  // NAME_MAX of every common file system
  const auto bad = [&](std::string_view what) {
    return InvalidField("BAD_FILE_NAME", field,
                        absl::StrCat(Absl(what), "; send a plain file name such as 0001.jpg"));
  };
  if (name.empty()) return bad("the file name is empty");
  if (name.size() > kMaxNameBytes) {
    return bad(
        absl::StrCat("the file name has ", name.size(), " bytes, more than ", kMaxNameBytes));
  }
  if (name.front() == '.') return bad("the file name starts with a dot");
  for (size_t i = 0; i < name.size();) {
    const size_t length = Utf8Length(name.substr(i));
    if (length == 0) return bad("the file name is not valid UTF-8");
    const uint8_t c = uint8_t(name[i]);
    if (ControlLength(name.substr(i)) > 0) {
      return bad("the file name holds a control character, or one that turns text around");
    }
    if (c == '/' || c == '\\') return bad("the file name holds a path separator");
    i += length;
  }
  return absl::OkStatus();
}

std::string BaseName(std::string_view path) {
  const size_t cut = path.find_last_of("/\\");
  return std::string(cut == std::string_view::npos ? path : path.substr(cut + 1));
}

std::string Stem(std::string_view path) {
  std::string name = BaseName(path);
  const size_t dot = name.rfind('.');
  if (dot != std::string::npos && dot > 0) name.resize(dot);
  return name;
}

std::vector<std::string> NamesInOneFolder(std::string_view path) {
  constexpr size_t kMaxFolders = 8;
  std::vector<std::string> names = {BaseName(path)};
  while (names.size() <= kMaxFolders) {
    const size_t end = path.find_last_of("/\\");
    if (end == std::string_view::npos) break;
    path = path.substr(0, end);
    const std::string folder = BaseName(path);
    if (folder.empty() || folder == "." || folder == "..") continue;
    names.push_back(absl::StrCat(folder, "_", names.back()));
  }
  std::reverse(names.begin(), names.end());
  return names;
}

std::string StemKey(std::string_view name) { return NameKey(Stem(name)); }

std::vector<std::string> KeysOf(std::string_view path) {
  std::set<std::string> keys;
  for (const std::string& form : {std::string(path), WithoutPercent(path)}) {
    for (const std::string& name : NamesInOneFolder(form)) {
      keys.insert(NameKey(name));
      keys.insert(StemKey(name));
    }
  }
  return {keys.begin(), keys.end()};
}

NameIndex::NameIndex(absl::Span<const std::string> names) {
  for (size_t i = 0; i < names.size(); ++i) {
    by_name_.emplace(names[i], i);
    by_key_[NameKey(names[i])].push_back(i);
    by_stem_[StemKey(names[i])].push_back(i);
  }
}

std::optional<size_t> NameIndex::FindExact(const std::string& path) const {
  for (const std::string& name : NamesInOneFolder(path)) {
    if (const auto found = by_name_.find(name); found != by_name_.end()) return found->second;
  }
  return std::nullopt;
}

std::vector<size_t> NameIndex::FindAlike(const std::string& path) const {
  const auto of = [](const Indices& indices, const std::string& key) {
    const auto found = indices.find(key);
    return found == indices.end() ? std::vector<size_t>() : found->second;
  };
  for (const std::string& form : {path, WithoutPercent(path)}) {
    for (const std::string& name : NamesInOneFolder(form)) {
      const std::string key = NameKey(name), stem = StemKey(name);
      if (auto whole = of(by_key_, key); !whole.empty()) return whole;
      // A name without an ending may have dots: what follows the last is no ending then.
      std::vector<size_t> alike = of(by_stem_, key);
      if (stem != key) {
        for (const size_t i : of(by_stem_, stem)) alike.push_back(i);
      }
      if (!alike.empty()) return alike;
    }
  }
  return {};
}

std::optional<size_t> NameIndex::Find(const std::string& path) const {
  if (const auto exact = FindExact(path)) return exact;
  const std::vector<size_t> alike = FindAlike(path);
  return alike.empty() ? std::nullopt : std::optional(alike[0]);
}

}  // namespace litags
