// Files on their way into a job: what is there, what is missing, and how they are kept.
#ifndef LITAGS_SERVER_JOBS_UPLOADS_H_
#define LITAGS_SERVER_JOBS_UPLOADS_H_

#include <array>
#include <cstdint>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/types/span.h"
#include "engine/core/cancel.h"
#include "engine/core/limits.h"
#include "server/store/blob_store.h"
#include "server/store/job_store.h"
#include "server/store/partial_files.h"

namespace litags {

// What an upload may cost.
struct UploadLimits {
  int64_t max_files = 10000;                // per job, those on their way included
  int64_t max_file_bytes = kMaxImageBytes;  // photos, masks, depth maps
  int64_t max_video_bytes = kMaxVideoBytes;
  int64_t max_cameras_bytes = kMaxCamerasBytes;  // transforms.json
  int64_t max_job_bytes = kMaxJobBytes;          // all files of a job
  double max_silence_seconds = 60;               // between two messages of a stream
  double keep_seconds = 24 * 3600;               // a job that is not started and gets no files
  // Larger files come to the blob store in pieces of so much while they are on their way, so that
  // another server can go on with them; 0: there is no other one.
  int64_t chunk_bytes = 0;
};

// How much of a file an upload may leave out.
struct FileStatus {
  bool stored = false;  // the job has it
  int64_t offset = 0;   // bytes that need not be sent; all of them: the header is enough
};

// What all views of the jobs of one data folder share: files on their way, and who adds files.
struct UploadArea {
  UploadArea(std::string partials_root, BlobStore* blobs, UploadLimits limits)
      : limits(limits), partials(std::move(partials_root), {blobs, limits.chunk_bytes}) {}
  const UploadLimits limits;
  PartialFiles partials;
  // Files of one owner are announced one at a time, so that no two take the same room. By a hash
  // of the owner.
  std::array<std::mutex, 16> announce_mutexes;
};

// Thread-safe. Errors: those of JobStore, BlobStore, PartialFiles and NextState(), UNAVAILABLE
// (JOB_BUSY) while what the job's earlier uploads left is removed, and what each call says. In a
// FileRecord, role, name, size and digest must be set; names must be checked.
class Uploads {
 public:
  // The stores must outlive this. `max_owner_bytes`: of all files of one owner's jobs, those on
  // their way included; 0: no limit.
  Uploads(ClientStore* store, BlobStore* blobs, std::shared_ptr<UploadArea> area, Clock clock,
          int64_t max_owner_bytes = 0)
      : store_(store),
        blobs_(blobs),
        area_(std::move(area)),
        clock_(std::move(clock)),
        max_owner_bytes_(max_owner_bytes) {}

  const UploadLimits& limits() const { return area_->limits; }
  PartialFiles& partials() { return area_->partials; }
  const std::shared_ptr<UploadArea>& area() const { return area_; }

  // OK if the job takes files, or will: see Reopen(). Counts as a sign of life: the job expires
  // later.
  absl::Status Check(std::string_view id);
  // How often Check() is to be called while one file comes in: another server, which does not see
  // the stream, removes a job that expires.
  double check_seconds() const;

  // What of each file is on disk.
  absl::StatusOr<std::vector<FileStatus>> Query(std::string_view id,
                                                const std::vector<FileRecord>& files);
  absl::StatusOr<bool> IsStored(std::string_view id, const FileRecord& file);

  // Takes a file's bytes from `offset` on. RESOURCE_EXHAUSTED (TOO_MANY_FILES, JOB_TOO_LARGE,
  // BYTE_QUOTA_REACHED), OUT_OF_RANGE (OFFSET_INVALID).
  absl::StatusOr<std::unique_ptr<PartialFile>> Open(std::string_view id, const FileRecord& file,
                                                    int64_t offset);

  // Keeps a checked file whose bytes are at `path`; the file at `path` is consumed. Bytes that
  // another job has already take no more room; a job that lost them has them again. On disk when it
  // returns. RESOURCE_EXHAUSTED (TOO_MANY_FILES, JOB_TOO_LARGE), INVALID_ARGUMENT (CAMERAS_TWICE).
  absl::Status Add(std::string_view id, const FileRecord& file, const std::string& path);

  // The same with the bytes of a file of the same digest and role in this job or in another one of
  // the same owner. False if there is none.
  absl::StatusOr<bool> Adopt(std::string_view id, const FileRecord& file);

  // The same of files of the job `source`, of the same owner, and of notes of archives. ABORTED
  // (CLONED_FILE_GONE): that job lost one. The job `id` has those before it then; so it has those
  // before a cancel.
  absl::Status AdoptFrom(std::string_view source, std::string_view id,
                         absl::Span<const FileRecord> files, const CancelToken& cancel);

  // Takes a file out of the job again, and with it the notes of NoteArchive(), whichever archive it
  // came from. False if there is none of this role and name.
  absl::StatusOr<bool> Remove(std::string_view id, FileRole role, std::string_view name);

  // Notes that an archive was unpacked, so that it need not come again; of itself nothing is kept.
  absl::Status NoteArchive(std::string_view id, FileRecord archive);

  // Removes the job's files that are on their way, chunks in the blob store too.
  absl::Status RemovePartialsOf(std::string_view id);

  // Removes every byte of a job that is deleted.
  absl::Status RemoveAllOf(std::string_view id);

  // When a job that now got a file, and is not started, may be removed.
  int64_t Expiry() const { return clock_() + static_cast<int64_t>(1000 * limits().keep_seconds); }

 private:
  // What a job has that matters to a file that comes: never all rows, of which there may be many.
  struct Present {
    std::optional<FileRecord> named;  // of the same role and name
    FileTally tally;                  // of the same bytes
    std::vector<FileRecord> cameras;  // of a job that gets some: all its files
    bool Has(const FileRecord& file) const { return named && named->sha256 == file.sha256; }
  };
  template <typename Rows>
  static absl::StatusOr<Present> LookUp(Rows rows, const FileRecord& file);
  absl::Status CheckRoom(const JobRecord& job, const Present& present, const FileRecord& file,
                         const PartialFiles::Usage& coming) const;
  absl::Status CheckQuota(const JobRecord& job, const FileRecord& file) const;
  absl::StatusOr<std::optional<JobFile>> FindBytes(std::string_view id, const FileRecord& file);
  // Whether the bytes are there, too, for many files at once. `blobs_of`: names of the blobs of
  // each job that was asked for.
  using BlobsOf = std::map<std::string, std::set<std::string>, std::less<>>;
  absl::StatusOr<bool> HasBlob(const std::string& id, const std::string& sha256,
                               BlobsOf* blobs_of) const;
  absl::Status StoreBytes(std::string_view id, const FileRecord& file, const std::string& path);
  // A FAILED job takes files again: UPLOADING before the first byte is stored, so that no sweep
  // takes it for waste. One with a finished scene does not, since its scene is of the files it has.
  absl::Status Reopen(std::string_view id);
  // The same in a transaction. What `kept` names is to be removed after: it would cost the client
  // nothing and stay as long as the job takes files.
  absl::Status ReopenIn(JobTransaction& job, std::string* kept) const;
  void RemoveKept(std::string_view id, const std::string& kept);
  // `returning`: see CheckAdd().
  absl::Status PutRow(std::string_view id, const FileRecord& file, int64_t returning);
  absl::Status PutRows(std::string_view id, absl::Span<const FileRecord> files, int64_t returning);
  // Returns how many bytes of JobRecord::unreferenced_bytes are the file's own, which was removed.
  absl::StatusOr<int64_t> CheckAdd(std::string_view id, const FileRecord& file);
  void NoteUnreferencedBlobs(std::string_view id);

  ClientStore* const store_;
  BlobStore* const blobs_;
  const std::shared_ptr<UploadArea> area_;
  const Clock clock_;
  const int64_t max_owner_bytes_;
};

}  // namespace litags

#endif  // LITAGS_SERVER_JOBS_UPLOADS_H_
