#ifndef LITAGS_SERVER_STORE_PARTIAL_FILES_H_
#define LITAGS_SERVER_STORE_PARTIAL_FILES_H_

#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/store/digest.h"

namespace litags {

// Who may write a partial file: whoever opened it last. Shared by all that have it open.
struct PartialSlot {
  std::mutex mutex;
  uint64_t writer = 0;
};

// One file on its way in: the bytes so far, and their digest. What has come stays for the next
// stream when this object ends, unless Discard() or the reader of path() removed it.
class PartialFile {
 public:
  ~PartialFile();  // a file without bytes is removed
  PartialFile(const PartialFile&) = delete;
  PartialFile& operator=(const PartialFile&) = delete;

  int64_t size() const { return size_; }
  const std::string& path() const { return path_; }

  // ABORTED (UPLOAD_TAKEN_OVER) if another stream has opened the file since, or its job is gone;
  // RESOURCE_EXHAUSTED (DISK_FULL).
  absl::Status Append(std::string_view bytes);
  // SHA-256 of all bytes so far, 64 hex digits. Call once; nothing may be appended after.
  std::string HexDigest() { return sha_.HexDigest(); }
  // Removes the file, unless it was taken over.
  void Discard();

 private:
  friend class PartialFiles;
  PartialFile(std::shared_ptr<PartialSlot> slot, uint64_t writer, std::string path)
      : slot_(std::move(slot)), writer_(writer), path_(std::move(path)) {}
  absl::Status OpenAt(int64_t offset);
  absl::Status Lost() const;

  const std::shared_ptr<PartialSlot> slot_;
  const uint64_t writer_;
  const std::string path_;
  int fd_ = -1;
  int64_t size_ = 0;
  Sha256 sha_;
};

// Files that have come in part, one folder per job. Keys are lower-case hex digits made by us.
// Thread-safe; for one process at a time.
//
// Errors: RESOURCE_EXHAUSTED (DISK_FULL), INTERNAL (STORE_FAILED).
class PartialFiles {
 public:
  explicit PartialFiles(std::string root) : root_(std::move(root)) {}

  // Bytes of the file that are on disk now; 0 if there are none.
  absl::StatusOr<int64_t> Size(std::string_view job_id, std::string_view key);

  // Takes the file over, from `offset` on: bytes beyond it are dropped, those before are read once
  // for the digest. OUT_OF_RANGE (OFFSET_INVALID) if fewer are there.
  absl::StatusOr<std::unique_ptr<PartialFile>> Open(std::string_view job_id, std::string_view key,
                                                    int64_t offset);

  // Whether a stream has a file of the job open.
  bool InUse(std::string_view job_id);
  // Files and bytes of the job.
  struct Usage {
    int64_t files = 0, bytes = 0;
  };
  Usage UsageOf(std::string_view job_id) const;

  // Removes the job's files; streams that have one open lose it.
  absl::Status RemoveJob(std::string_view job_id);

 private:
  std::string Folder(std::string_view job_id) const;
  // Keys of slots are "JOB/KEY".
  std::shared_ptr<PartialSlot> SlotOf(const std::string& name);

  const std::string root_;
  std::mutex mutex_;
  uint64_t next_writer_ = 1;
  std::map<std::string, std::weak_ptr<PartialSlot>> slots_;
};

}  // namespace litags

#endif  // LITAGS_SERVER_STORE_PARTIAL_FILES_H_
