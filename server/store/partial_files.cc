#include "server/store/partial_files.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <filesystem>
#include <functional>
#include <vector>

#include "absl/strings/str_cat.h"
#include "engine/core/check.h"
#include "engine/core/error.h"
#include "server/store/file_error.h"

namespace litags {
namespace {

namespace fs = std::filesystem;

constexpr size_t kReadBytes = size_t{1} << 20;
constexpr uint64_t kNobody = 0;
constexpr char kAside[] = ".";  // between a key and the writer that set the file aside: "KEY.7"

bool IsAside(const std::string& name) {
  return name.find_first_not_of("0123456789abcdef.") == std::string::npos &&
         name.find(kAside) != std::string::npos;
}

}  // namespace

PartialFile::~PartialFile() {
  if (fd_ < 0) return;  // could not be opened: whatever is there stays
  close(fd_);
  if (size_ == 0) Discard();
  PutBack();
}

absl::Status UploadTakenOver() {
  return MakeError(absl::StatusCode::kAborted, "UPLOAD_TAKEN_OVER", "",
                   "another stream sends this file now, or the job was cancelled or deleted; "
                   "upload a file by one stream at a time");
}

absl::Status PartialFile::CheckWriter() const {
  return slot_->writer == writer_ ? absl::OkStatus() : UploadTakenOver();
}

absl::Status PartialFile::CheckHeld() const {
  std::lock_guard lock(slot_->mutex);
  return CheckWriter();
}

absl::Status PartialFile::BringChunks(int64_t offset) {
  const off_t there = lseek(fd_, 0, SEEK_END);
  if (there < 0) return FileError("read", path_, errno);
  if (there >= offset) return absl::OkStatus();
  size_ = there;
  return chunks_->Read(job_id_, key_, there, [this](std::string_view bytes) -> absl::Status {
    std::lock_guard lock(slot_->mutex);
    LITAGS_RETURN_IF_ERROR(CheckWriter());
    return Write(bytes);
  });
}

absl::Status PartialFile::OpenAt(int64_t offset) {
  fd_ = open(path_.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0600);
  if (fd_ < 0) return FileError("open", path_, errno);
  if (chunks_) LITAGS_RETURN_IF_ERROR(BringChunks(offset));
  LITAGS_RETURN_IF_ERROR(SeekTo(offset));
  if (!chunks_) return absl::OkStatus();
  LITAGS_ASSIGN_OR_RETURN(const int64_t stored, chunks_->Size(job_id_, key_));
  in_chunks_ = std::min(stored, size_);
  return absl::OkStatus();
}

absl::Status PartialFile::SeekTo(int64_t offset) {
  std::lock_guard lock(slot_->mutex);
  LITAGS_RETURN_IF_ERROR(CheckWriter());
  struct stat status;
  if (fstat(fd_, &status) != 0) return FileError("open", path_, errno);
  size_ = status.st_size;
  if (offset < 0 || size_ < offset) {
    return MakeError(absl::StatusCode::kOutOfRange, "OFFSET_INVALID", "",
                     absl::StrCat("offset is ", offset, ", but the server has ", size_,
                                  " bytes of this file; ask QueryUpload again"));
  }
  if (ftruncate(fd_, offset) != 0 || lseek(fd_, offset, SEEK_SET) != offset) {
    return FileError("truncate", path_, errno);
  }
  size_ = offset;
  return absl::OkStatus();
}

absl::StatusOr<bool> PartialFile::CatchUp(int64_t max_bytes) {
  const int64_t end = std::min(size_, hashed_ + std::min(max_bytes, size_));
  std::string chunk(static_cast<size_t>(std::min<int64_t>(end - hashed_, kReadBytes)), '\0');
  int failed = 0;
  while (hashed_ < end && failed == 0) {
    const auto wanted = static_cast<size_t>(std::min<int64_t>(kReadBytes, end - hashed_));
    const ssize_t n = pread(fd_, chunk.data(), wanted, hashed_);
    if (n < 0 && errno == EINTR) continue;
    if (n <= 0) {
      failed = n < 0 ? errno : EIO;
    } else {
      sha_.Update({chunk.data(), static_cast<size_t>(n)});
      hashed_ += n;
    }
  }
  // A stream that took the file over may have changed or cut what was read.
  std::lock_guard lock(slot_->mutex);
  LITAGS_RETURN_IF_ERROR(CheckWriter());
  if (failed != 0) return FileError("read", path_, failed);
  return hashed_ == size_;
}

absl::StatusOr<std::string> PartialFile::HexDigest() {
  LITAGS_RETURN_IF_ERROR(CatchUp(size_).status());
  return sha_.HexDigest();
}

absl::Status PartialFile::Append(std::string_view bytes) {
  if (hashed_ < size_) LITAGS_RETURN_IF_ERROR(CatchUp(size_).status());
  std::lock_guard lock(slot_->mutex);
  LITAGS_RETURN_IF_ERROR(CheckWriter());
  sha_.Update(bytes);
  LITAGS_RETURN_IF_ERROR(Write(bytes));
  hashed_ = size_;
  return chunks_ ? StoreChunks() : absl::OkStatus();
}

absl::Status PartialFile::StoreChunks() {
  const int64_t chunk_bytes = chunks_->chunk_bytes();
  while (size_ - in_chunks_ >= chunk_bytes) {
    std::string chunk(static_cast<size_t>(chunk_bytes), '\0');
    for (size_t done = 0; done < chunk.size();) {
      const ssize_t n = pread(fd_, chunk.data() + done, chunk.size() - done,
                              in_chunks_ + static_cast<off_t>(done));
      if (n < 0 && errno == EINTR) continue;
      if (n <= 0) return FileError("read", path_, n < 0 ? errno : EIO);
      done += static_cast<size_t>(n);
    }
    LITAGS_RETURN_IF_ERROR(chunks_->Put(job_id_, key_, in_chunks_, chunk));
    in_chunks_ += chunk_bytes;
  }
  return absl::OkStatus();
}

absl::Status PartialFile::Write(std::string_view bytes) {
  const int error = WriteAll(fd_, bytes, &size_);
  return error ? FileError("write", path_, error) : absl::OkStatus();
}

absl::Status PartialFile::SetAside() {
  std::lock_guard lock(slot_->mutex);
  LITAGS_RETURN_IF_ERROR(CheckWriter());
  const std::string aside = absl::StrCat(path_, kAside, writer_);
  if (rename(path_.c_str(), aside.c_str()) != 0) return FileError("move", path_, errno);
  aside_ = aside;
  return absl::OkStatus();
}

void PartialFile::PutBack() {
  if (aside_.empty()) return;
  std::lock_guard lock(slot_->mutex);
  if (CheckWriter().ok()) {
    rename(aside_.c_str(), path_.c_str());
  } else {
    unlink(aside_.c_str());
  }
}

void PartialFile::Discard() {
  std::lock_guard lock(slot_->mutex);
  if (!aside_.empty()) unlink(aside_.c_str());
  aside_.clear();
  if (slot_->writer != writer_) return;
  slot_->writer = kNobody;
  unlink(path_.c_str());
  if (chunks_ && size_ > 0)
    chunks_->Remove(job_id_, key_).IgnoreError();  // gone at the latest with the upload
}

PartialFiles::PartialFiles(std::string root, UploadChunks chunks)
    : root_(std::move(root)), chunks_(chunks) {
  std::error_code error;
  for (fs::directory_iterator job(root_, error), end; !error && job != end; job.increment(error)) {
    std::vector<fs::path> aside;
    std::error_code no_folder;
    for (fs::directory_iterator file(job->path(), no_folder); !no_folder && file != end;
         file.increment(no_folder)) {
      if (IsAside(file->path().filename())) aside.push_back(file->path());
    }
    for (const fs::path& path : aside) {
      rename(path.c_str(), fs::path(path).replace_extension().c_str());
    }
  }
}

std::string PartialFiles::Folder(std::string_view job_id) const {
  LITAGS_CHECK(!job_id.empty() && job_id.find_first_of("./") == std::string_view::npos);
  return absl::StrCat(root_, "/", std::string(job_id));
}

absl::StatusOr<int64_t> PartialFiles::Size(std::string_view job_id, std::string_view key,
                                           int64_t file_bytes) {
  int64_t in_chunks = 0;
  if (const UploadChunks* chunks = ChunksOf(file_bytes)) {
    LITAGS_ASSIGN_OR_RETURN(in_chunks, chunks->Size(job_id, key));
  }
  const std::string path = absl::StrCat(Folder(job_id), "/", std::string(key));
  const int fd = open(path.c_str(), O_RDONLY | O_CLOEXEC);
  if (fd < 0) {
    if (errno == ENOENT) return in_chunks;
    return FileError("open", path, errno);
  }
  struct stat status;
  // Synced: what is announced here is not sent again.
  const bool ok = fstat(fd, &status) == 0 && fdatasync(fd) == 0;
  const int error = errno;
  close(fd);
  if (!ok) return FileError("sync", path, error);
  return std::max<int64_t>(in_chunks, status.st_size);
}

std::shared_ptr<PartialSlot> PartialFiles::Announce(std::string_view job_id, std::string_view key,
                                                    int64_t file_bytes) {
  std::lock_guard lock(mutex_);
  std::erase_if(slots_, [](const auto& entry) { return entry.second.expired(); });
  auto& entry = slots_[absl::StrCat(std::string(job_id), "/", std::string(key))];
  std::shared_ptr<PartialSlot> slot = entry.lock();
  if (!slot) entry = slot = std::make_shared<PartialSlot>();
  slot->file_bytes = file_bytes;
  return slot;
}

absl::StatusOr<std::unique_ptr<PartialFile>> PartialFiles::Open(std::string_view job_id,
                                                                std::string_view key,
                                                                int64_t file_bytes,
                                                                int64_t offset) {
  const std::string folder = Folder(job_id);
  const std::shared_ptr<PartialSlot> slot = Announce(job_id, key, file_bytes);
  uint64_t writer = 0;
  {
    std::lock_guard lock(mutex_);
    writer = next_writer_++;
    std::error_code error;
    fs::create_directories(folder, error);
    if (error) return FileError("create", folder, error.value());
  }
  const std::string path = absl::StrCat(folder, "/", std::string(key));
  std::unique_ptr<PartialFile> file(new PartialFile(slot, writer, std::string(job_id),
                                                    std::string(key), path, ChunksOf(file_bytes)));
  {
    std::lock_guard lock(slot->mutex);  // an append of the writer before is over now
    slot->writer = writer;
  }
  LITAGS_RETURN_IF_ERROR(file->OpenAt(offset));
  return file;
}

bool PartialFiles::InUse(std::string_view job_id) {
  const std::string prefix = absl::StrCat(std::string(job_id), "/");
  std::lock_guard lock(mutex_);
  for (auto it = slots_.lower_bound(prefix); it != slots_.end(); ++it) {
    if (!it->first.starts_with(prefix)) return false;
    if (!it->second.expired()) return true;
  }
  return false;
}

PartialFiles::Usage PartialFiles::UsageOf(std::string_view job_id, std::string_view but_key) {
  std::map<std::string, int64_t, std::less<>> bytes_of;  // by key
  std::error_code error;
  const fs::path folder = Folder(job_id);
  for (fs::directory_iterator it(folder, error), end; !error && it != end; it.increment(error)) {
    std::error_code gone;  // it may have become complete just now
    const auto bytes = it->file_size(gone);
    const std::string name = it->path().filename();
    // A file that is set aside is announced: it counts as that.
    if (!gone && name.find(kAside) == std::string::npos) {
      bytes_of[name] = static_cast<int64_t>(bytes);
    }
  }
  {
    const std::string prefix = absl::StrCat(std::string(job_id), "/");
    std::lock_guard lock(mutex_);
    for (auto it = slots_.lower_bound(prefix); it != slots_.end(); ++it) {
      if (!it->first.starts_with(prefix)) break;
      const auto slot = it->second.lock();
      if (slot) bytes_of[it->first.substr(prefix.size())] = slot->file_bytes;
    }
  }
  Usage usage;
  for (const auto& [key, bytes] : bytes_of) {
    if (key == but_key) continue;
    ++usage.files;
    usage.bytes += bytes;
  }
  return usage;
}

absl::Status PartialFiles::RemoveJob(std::string_view job_id) {
  const std::string prefix = absl::StrCat(std::string(job_id), "/");
  std::vector<std::shared_ptr<PartialSlot>> slots;
  {
    std::lock_guard lock(mutex_);
    for (auto it = slots_.lower_bound(prefix); it != slots_.end() && it->first.starts_with(prefix);
         it = slots_.erase(it)) {
      if (auto slot = it->second.lock()) slots.push_back(std::move(slot));
    }
  }
  // Others' files must not wait for a write to one of these.
  for (const auto& slot : slots) {
    std::lock_guard lock(slot->mutex);
    slot->writer = kNobody;
  }
  std::lock_guard lock(mutex_);
  std::error_code error;
  fs::remove_all(Folder(job_id), error);
  return error ? FileError("remove", Folder(job_id), error.value()) : absl::OkStatus();
}

}  // namespace litags
