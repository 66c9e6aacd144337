#ifndef LITAGS_SERVER_STORE_PARTIAL_FILES_H_
#define LITAGS_SERVER_STORE_PARTIAL_FILES_H_

#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/store/digest.h"
#include "server/store/upload_chunks.h"

namespace litags {

// ABORTED (UPLOAD_TAKEN_OVER): another stream sends the file, or its job is gone.
absl::Status UploadTakenOver();

// Who may write a partial file: whoever opened it last. Shared by all that have it open.
struct PartialSlot {
  std::mutex mutex;  // held for a write, never for a whole file
  uint64_t writer = 0;
  int64_t file_bytes = 0;  // that the file will have; under the mutex of PartialFiles
};

// One file on its way in: the bytes so far, and their digest. What has come stays for the next
// stream when this object ends, unless Discard() removed it.
class PartialFile {
 public:
  ~PartialFile();  // a file without bytes is removed
  PartialFile(const PartialFile&) = delete;
  PartialFile& operator=(const PartialFile&) = delete;

  int64_t size() const { return size_; }
  const std::string& path() const { return aside_.empty() ? path_ : aside_; }

  // Reads on in what came before this stream, for the digest: of a large file, a second or so for
  // each 500 MB. Returns whether that is done; reads up to `max_bytes`. Append() and HexDigest()
  // read what is left. ABORTED, as Append().
  absl::StatusOr<bool> CatchUp(int64_t max_bytes);

  // ABORTED (UPLOAD_TAKEN_OVER) if another stream has opened the file since, or its job is gone;
  // RESOURCE_EXHAUSTED (DISK_FULL); where pieces go to the blob store, its errors.
  absl::Status Append(std::string_view bytes);
  // SHA-256 of all bytes so far, 64 hex digits. Call once; nothing may be appended after.
  absl::StatusOr<std::string> HexDigest();
  // ABORTED (UPLOAD_TAKEN_OVER), as Append().
  absl::Status CheckHeld() const;
  // Moves the whole file to another path(), to be stored from there: a stream that opens it from
  // now on gets another file, and cannot write to this one. It comes back when this object ends,
  // unless it is gone by then, or taken over. ABORTED, as Append().
  absl::Status SetAside();
  // Removes the file, unless it was taken over.
  void Discard();

 private:
  friend class PartialFiles;
  PartialFile(std::shared_ptr<PartialSlot> slot, uint64_t writer, std::string job_id,
              std::string key, std::string path, const UploadChunks* chunks)
      : slot_(std::move(slot)),
        writer_(writer),
        job_id_(std::move(job_id)),
        key_(std::move(key)),
        path_(std::move(path)),
        chunks_(chunks) {}
  absl::Status OpenAt(int64_t offset);
  absl::Status BringChunks(int64_t offset);  // into a file that has fewer bytes
  absl::Status SeekTo(int64_t offset);
  absl::Status Write(std::string_view bytes);
  absl::Status StoreChunks();
  void PutBack();
  // UPLOAD_TAKEN_OVER unless this may write. Under the slot's mutex.
  absl::Status CheckWriter() const;

  const std::shared_ptr<PartialSlot> slot_;
  const uint64_t writer_;
  const std::string job_id_, key_, path_;
  const UploadChunks* const chunks_;  // null: the file is too small for them
  int fd_ = -1;
  int64_t size_ = 0;
  int64_t hashed_ = 0;     // of them
  int64_t in_chunks_ = 0;  // of them
  std::string aside_;      // where the file is; empty: at path_
  Sha256 sha_;
};

// Files that have come in part, one folder per job. Keys are lower-case hex digits made by us.
// Thread-safe; for one process at a time. With chunks, large files go on at another process, too:
// at the last full chunk, where theirs ends earlier.
//
// Errors: RESOURCE_EXHAUSTED (DISK_FULL), INTERNAL (STORE_FAILED), those of the chunks.
class PartialFiles {
 public:
  // Files that were set aside when the process before this one ended are partial ones again: whole,
  // and better than what a stream that took one over may have of it.
  explicit PartialFiles(std::string root, UploadChunks chunks = {nullptr, 0});

  // Bytes that are on disk now, here or in chunks, of a file that will have `file_bytes`.
  absl::StatusOr<int64_t> Size(std::string_view job_id, std::string_view key, int64_t file_bytes);

  // Makes the file count in UsageOf() with all the bytes that it will have, for as long as the
  // result is kept or the file is open.
  std::shared_ptr<PartialSlot> Announce(std::string_view job_id, std::string_view key,
                                        int64_t file_bytes);

  // Takes the file over, from `offset` on: bytes beyond it are dropped, those before are read by
  // PartialFile::CatchUp(). OUT_OF_RANGE (OFFSET_INVALID) if fewer are there.
  absl::StatusOr<std::unique_ptr<PartialFile>> Open(std::string_view job_id, std::string_view key,
                                                    int64_t file_bytes, int64_t offset);

  // Whether a stream has a file of the job open.
  bool InUse(std::string_view job_id);
  // Files and bytes of the job that lie here or are announced, but for one.
  struct Usage {
    int64_t files = 0, bytes = 0;
  };
  Usage UsageOf(std::string_view job_id, std::string_view but_key = "");
  const UploadChunks& chunks() const { return chunks_; }

  // Removes the job's files here, not their chunks; streams that have one open lose it.
  absl::Status RemoveJob(std::string_view job_id);

 private:
  const UploadChunks* ChunksOf(int64_t file_bytes) const {
    return chunks_.used() && file_bytes >= chunks_.chunk_bytes() ? &chunks_ : nullptr;
  }
  std::string Folder(std::string_view job_id) const;

  const std::string root_;
  const UploadChunks chunks_;
  std::mutex mutex_;
  uint64_t next_writer_ = 1;
  std::map<std::string, std::weak_ptr<PartialSlot>> slots_;  // by "JOB/KEY"
};

}  // namespace litags

#endif  // LITAGS_SERVER_STORE_PARTIAL_FILES_H_
