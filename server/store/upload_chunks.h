#ifndef LITAGS_SERVER_STORE_UPLOAD_CHUNKS_H_
#define LITAGS_SERVER_STORE_UPLOAD_CHUNKS_H_

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "absl/functional/function_ref.h"
#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/store/blob_store.h"

namespace litags {

// Pieces of large files on their way, as blobs "uploads/JOB/KEY/FIRST-END", so that another server
// of the same blob store can go on with a file. Keys are those of PartialFiles. What a file's
// pieces are together is known by its digest only when it is complete.
//
// Thread-safe. Errors: those of the blob store.
class UploadChunks {
 public:
  // `blobs` must outlive this; null, or 0 bytes: there are none.
  UploadChunks(BlobStore* blobs, int64_t chunk_bytes)
      : blobs_(chunk_bytes > 0 ? blobs : nullptr), chunk_bytes_(chunk_bytes) {}

  bool used() const { return blobs_ != nullptr; }
  int64_t chunk_bytes() const { return chunk_bytes_; }

  // Bytes from the file's beginning on that are stored.
  absl::StatusOr<int64_t> Size(std::string_view job_id, std::string_view key) const;
  absl::Status Put(std::string_view job_id, std::string_view key, int64_t first,
                   std::string_view bytes) const;
  // Calls `take` with the bytes from `from` on that are stored, in order.
  absl::Status Read(std::string_view job_id, std::string_view key, int64_t from,
                    absl::FunctionRef<absl::Status(std::string_view)> take) const;

  absl::Status Remove(std::string_view job_id, std::string_view key) const;
  absl::Status RemoveJob(std::string_view job_id) const;
  // Jobs that have pieces, and for how long nothing has come to one.
  absl::StatusOr<std::vector<std::string>> Jobs() const;
  absl::StatusOr<double> QuietSeconds(std::string_view job_id) const;

 private:
  struct Piece {
    int64_t first, end;
  };
  // Those that continue each other from the beginning on.
  absl::StatusOr<std::vector<Piece>> Chain(std::string_view job_id, std::string_view key) const;

  BlobStore* const blobs_;
  const int64_t chunk_bytes_;
};

}  // namespace litags

#endif  // LITAGS_SERVER_STORE_UPLOAD_CHUNKS_H_
