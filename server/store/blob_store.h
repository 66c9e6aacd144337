// Where bytes are kept: photos, depth maps, checkpoints, scenes, preview pictures.
#ifndef LITAGS_SERVER_STORE_BLOB_STORE_H_
#define LITAGS_SERVER_STORE_BLOB_STORE_H_

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace litags {

// Keys are paths of lower-case letters, digits, '-' and '/', made by us ("jobs/ID/SHA256",
// "jobs/ID/N/SHA256"), never by clients. A blob never changes. Thread-safe; several processes may
// share a store.
//
// Errors: NOT_FOUND (BLOB_NOT_FOUND), RESOURCE_EXHAUSTED (DISK_FULL), INTERNAL (STORE_FAILED). A
// store on another machine, beside these: UNAVAILABLE (BLOBS_UNAVAILABLE), FAILED_PRECONDITION
// (BLOBS_DENIED), DATA_LOSS (BLOB_DAMAGED) if a blob named by its SHA-256 has another one.
class BlobStore {
 public:
  virtual ~BlobStore() = default;

  // Stores bytes; on disk when it returns. Storing the same key again is a no-op.
  virtual absl::Status Put(std::string_view key, std::string_view bytes) = 0;
  // The same with a local file's content; the file is consumed.
  virtual absl::Status PutFile(std::string_view key, const std::string& path) = 0;

  virtual absl::StatusOr<bool> Has(std::string_view key) = 0;
  virtual absl::StatusOr<std::string> Get(std::string_view key) = 0;
  // Makes the blob readable as the local file `path`, which must not exist. The file may share its
  // bytes with the store: do not write to it.
  virtual absl::Status Fetch(std::string_view key, const std::string& path) = 0;

  // Makes the blob `from` known as `to`, too, without copying bytes where that can be helped; on
  // disk when it returns. `to` being there already is fine.
  virtual absl::Status Link(std::string_view from, std::string_view to) = 0;

  // Names of what is inside the folder `prefix`: the last parts of the keys of blobs and folders;
  // empty if there is no such folder.
  virtual absl::StatusOr<std::vector<std::string>> List(std::string_view prefix) = 0;
  // Since a blob came into the folder `prefix` last; infinity if there is no such folder. Of blobs
  // in folders inside it, a store on disk only sees that the first one came.
  virtual absl::StatusOr<double> QuietSeconds(std::string_view prefix) = 0;

  // Removes one blob; none there is fine.
  virtual absl::Status Remove(std::string_view key) = 0;
  // Removes all blobs whose keys begin with the folder `prefix` ("jobs/ID").
  virtual absl::Status RemoveFolder(std::string_view prefix) = 0;

  // Removes what killed processes left of blobs that they were writing; nothing of this day's,
  // since another process may still be at it.
  virtual void RemoveTemporary() {}
};

// What is inside a local folder; empty if there is no such folder.
struct FolderEntry {
  std::string name;
  double quiet_seconds = 0;  // since it was changed last; a new link to old bytes was changed now
};
absl::StatusOr<std::vector<FolderEntry>> ListFolder(const std::string& folder);

// A folder, made if it is not there. RemoveTemporary() removes what is older than
// `abandoned_seconds`.
absl::StatusOr<std::unique_ptr<BlobStore>> OpenDiskBlobStore(const std::string& path,
                                                             double abandoned_seconds = 24 * 3600);

// A bucket of Amazon S3, or of a server that speaks its protocol.
struct S3Options {
  std::string endpoint;  // "http://127.0.0.1:9000"; the bucket follows as the path's first part
  std::string region = "us-east-1";
  std::string bucket;
  std::string prefix;  // of all keys: empty, or "a/b/"
  std::string access_key, secret_key;
  std::string session_token;               // of temporary credentials; else empty
  int64_t part_bytes = int64_t{16} << 20;  // larger blobs come and go in parts; 5 MiB at least
  int page_names = 1000;                   // names that one answer to a listing holds
  double patience_seconds = 30;            // with a server that is away or says nothing
  double abandoned_seconds = 24 * 3600;    // an upload in parts that began so long ago
};

// The bucket must be there. FAILED_PRECONDITION (BLOBS_DENIED), UNAVAILABLE (BLOBS_UNAVAILABLE).
absl::StatusOr<std::unique_ptr<BlobStore>> OpenS3BlobStore(S3Options options);

}  // namespace litags

#endif  // LITAGS_SERVER_STORE_BLOB_STORE_H_
