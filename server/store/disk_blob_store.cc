#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <limits>
#include <sstream>

#include "absl/strings/str_cat.h"
#include "engine/core/check.h"
#include "engine/core/error.h"
#include "engine/core/unique_fd.h"
#include "server/store/blob_store.h"
#include "server/store/digest.h"
#include "server/store/file_error.h"

namespace litags {
namespace {

namespace fs = std::filesystem;

constexpr char kTemporaryPrefix[] = "put-";

absl::Status ErrorOf(const char* action, const fs::path& path, int error) {
  if (error == ENOENT) {
    return MakeError(absl::StatusCode::kNotFound, "BLOB_NOT_FOUND", "",
                     absl::StrCat("no stored file ", path.filename().string()));
  }
  return FileError(action, path, error);
}

absl::Status Sync(const fs::path& path) {
  const UniqueFd fd(open(path.c_str(), O_RDONLY | O_CLOEXEC));
  if (!fd.valid() || fsync(fd.get()) != 0) return ErrorOf("sync", path, errno);
  return absl::OkStatus();
}

absl::Status WriteNew(const fs::path& path, std::string_view bytes) {
  UniqueFd fd(open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0600));
  if (!fd.valid()) return ErrorOf("create", path, errno);
  int error = WriteAll(fd.get(), bytes);
  if (!fd.Close() && error == 0) error = errno;
  return error ? ErrorOf("write", path, error) : absl::OkStatus();
}

class DiskBlobStore : public BlobStore {
 public:
  DiskBlobStore(fs::path root, double abandoned_seconds)
      : root_(std::move(root)), abandoned_seconds_(abandoned_seconds) {}

  absl::Status Put(std::string_view key, std::string_view bytes) override {
    const fs::path temporary = TemporaryPath();
    absl::Status status = WriteNew(temporary, bytes);
    if (status.ok()) status = PutFile(key, temporary);
    unlink(temporary.c_str());  // still there after a failure only
    return status;
  }

  absl::Status PutFile(std::string_view key, const std::string& path) override {
    const fs::path target = PathOf(key);
    LITAGS_RETURN_IF_ERROR(MakeFolder(target.parent_path()));
    // Content, then name, then folder: each is on disk before the next says so.
    LITAGS_RETURN_IF_ERROR(Sync(path));
    if (rename(path.c_str(), target.c_str()) == 0) return Sync(target.parent_path());
    if (errno != EXDEV) return ErrorOf("store", target, errno);
    LITAGS_RETURN_IF_ERROR(Copy(path, key));  // a file system of its own
    unlink(path.c_str());
    return absl::OkStatus();
  }

  absl::StatusOr<bool> Has(std::string_view key) override {
    const fs::path path = PathOf(key);
    if (access(path.c_str(), F_OK) == 0) return true;
    if (errno == ENOENT) return false;
    return ErrorOf("look for", path, errno);
  }

  absl::StatusOr<std::string> Get(std::string_view key) override {
    const fs::path path = PathOf(key);
    std::ifstream file(path, std::ios::binary);
    if (!file) return ErrorOf("read", path, errno);
    std::ostringstream bytes;
    bytes << file.rdbuf();
    if (file.bad()) return ErrorOf("read", path, EIO);
    return std::move(bytes).str();
  }

  absl::Status Fetch(std::string_view key, const std::string& path) override {
    const fs::path source = PathOf(key);
    if (link(source.c_str(), path.c_str()) == 0) return absl::OkStatus();
    if (errno == ENOENT) return ErrorOf("read", source, ENOENT);
    const int error = CopyFile(source, path);  // another file system
    return error ? ErrorOf("copy", source, error) : absl::OkStatus();
  }

  absl::Status Link(std::string_view from, std::string_view to) override {
    const fs::path source = PathOf(from), target = PathOf(to);
    LITAGS_RETURN_IF_ERROR(MakeFolder(target.parent_path()));
    if (link(source.c_str(), target.c_str()) == 0 || errno == EEXIST) {
      return Sync(target.parent_path());
    }
    if (errno == ENOENT) return ErrorOf("link", source, ENOENT);
    return Copy(source, to);  // a file system without hard links
  }

  absl::StatusOr<std::vector<std::string>> List(std::string_view prefix) override {
    LITAGS_ASSIGN_OR_RETURN(const auto entries, ListFolder(PathOf(prefix)));
    std::vector<std::string> names;
    for (const FolderEntry& entry : entries) names.push_back(entry.name);
    return names;
  }

  absl::StatusOr<double> QuietSeconds(std::string_view prefix) override {
    std::error_code error;
    const auto time = fs::last_write_time(PathOf(prefix), error);
    if (error) return std::numeric_limits<double>::infinity();
    return std::chrono::duration<double>(fs::file_time_type::clock::now() - time).count();
  }

  absl::Status Remove(std::string_view key) override {
    const fs::path path = PathOf(key);
    if (unlink(path.c_str()) != 0 && errno != ENOENT) return ErrorOf("remove", path, errno);
    return absl::OkStatus();
  }

  absl::Status RemoveFolder(std::string_view prefix) override {
    std::error_code error;
    fs::remove_all(PathOf(prefix), error);
    return error ? ErrorOf("remove", PathOf(prefix), error.value()) : absl::OkStatus();
  }

  void RemoveTemporary() override {
    const auto entries = ListFolder(root_ / "tmp");
    if (!entries.ok()) return;  // the next time, then
    for (const FolderEntry& entry : *entries) {
      if (!entry.name.starts_with(kTemporaryPrefix)) continue;
      if (entry.quiet_seconds < abandoned_seconds_) continue;
      unlink((root_ / "tmp" / entry.name).c_str());  // another server may have done it just now
    }
  }

  absl::Status MakeFolder(const fs::path& folder) {
    std::error_code error;
    if (fs::create_directories(folder, error)) {
      // A new folder is an entry in its parent, which must survive a crash too.
      for (fs::path p = folder; p != root_ && p != p.parent_path(); p = p.parent_path()) {
        LITAGS_RETURN_IF_ERROR(Sync(p.parent_path()));
      }
    }
    return error ? ErrorOf("create", folder, error.value()) : absl::OkStatus();
  }

 private:
  absl::Status Copy(const fs::path& source, std::string_view key) {
    const fs::path temporary = TemporaryPath();
    const int error = CopyFile(source, temporary);
    absl::Status status = error ? ErrorOf("copy", source, error) : PutFile(key, temporary);
    unlink(temporary.c_str());
    return status;
  }

  fs::path TemporaryPath() const {
    return root_ / "tmp" / absl::StrCat(kTemporaryPrefix, RandomHex(8));
  }

  fs::path PathOf(std::string_view key) const {
    LITAGS_CHECK(!key.empty() && key.front() != '/' &&
                 std::all_of(key.begin(), key.end(), [](char c) {
                   return (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '-' || c == '/';
                 }));
    return root_ / std::string(key);
  }

  const fs::path root_;
  const double abandoned_seconds_;
};

}  // namespace

absl::StatusOr<std::vector<FolderEntry>> ListFolder(const std::string& folder) {
  std::vector<FolderEntry> entries;
  std::error_code error;
  const std::chrono::duration<double> now = std::chrono::system_clock::now().time_since_epoch();
  for (fs::directory_iterator it(folder, error), end; !error && it != end; it.increment(error)) {
    struct stat info;
    if (stat(it->path().c_str(), &info) != 0) continue;  // gone
    const double changed =
        static_cast<double>(info.st_ctim.tv_sec) + 1e-9 * static_cast<double>(info.st_ctim.tv_nsec);
    entries.push_back({it->path().filename(), now.count() - changed});
  }
  if (error && error.value() != ENOENT) return ErrorOf("list", folder, error.value());
  return entries;
}

absl::StatusOr<std::unique_ptr<BlobStore>> OpenDiskBlobStore(const std::string& path,
                                                             double abandoned_seconds) {
  std::string root = path;  // no parent of a key's path would be "/folder/"
  while (root.size() > 1 && root.ends_with('/')) root.pop_back();
  auto store = std::make_unique<DiskBlobStore>(root, abandoned_seconds);
  std::error_code error;
  fs::create_directories(fs::path(root) / "tmp", error);
  if (error) return ErrorOf("create", root, error.value());
  return std::unique_ptr<BlobStore>(std::move(store));
}

}  // namespace litags
