#ifndef LITAGS_SERVER_STORE_OPEN_STORES_H_
#define LITAGS_SERVER_STORE_OPEN_STORES_H_

#include <memory>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/store/blob_store.h"
#include "server/store/data_dir.h"
#include "server/store/installation_marker.h"
#include "server/store/job_store.h"

namespace litags {

// Where an installation keeps its jobs and its bytes, as its operator says it.
struct StorePlaces {
  // "sqlite:///path/of/file" or "postgresql://..."; empty: litags.db in the data folder. May hold a
  // password: never shown.
  std::string jobs;
  // "file:///path/of/folder" or "s3://bucket/prefix"; empty: blobs/ in the data folder. The keys of
  // S3 are in AWS_ACCESS_KEY_ID, AWS_SECRET_ACCESS_KEY and AWS_SESSION_TOKEN, as everywhere.
  std::string blobs;
  // "https://host:port" of the S3 server; empty: Amazon's in AWS_REGION.
  std::string s3_endpoint;

  // INVALID_ARGUMENT (STORE_URL_INVALID, SETTING_UNUSED).
  absl::Status Validate() const;
  bool UsesPostgres() const;
  // Of a store that is not PostgreSQL's.
  std::string SqlitePath(const DataDir& data) const;
  // Where this machine's disks take what comes, each with the flag that says so.
  struct Folder {
    std::string path;
    const char* flag;
  };
  std::vector<Folder> LocalFolders(const DataDir& data) const;
  // Whether a process needs the network to reach them. Unix sockets do without.
  bool NeedNetwork() const;
  // What another process must have in its environment ("NAME=value") to open the same stores: these
  // places, and the keys and passwords that only their libraries look for.
  std::vector<std::string> Environment() const;
  // Whether storing a blob sends its bytes over a network, rather than giving a file another name.
  bool BlobsAreFar() const;
  static constexpr double kKeepSeconds = 60;  // between checkpoints sent there, if nobody says else
};

absl::StatusOr<std::unique_ptr<JobStore>> OpenJobStore(const StorePlaces& places,
                                                       const DataDir& data);
absl::StatusOr<std::unique_ptr<BlobStore>> OpenBlobStore(const StorePlaces& places,
                                                         const DataDir& data);

// The marker of the job store's installation in its blob store.
absl::StatusOr<std::unique_ptr<InstallationMarker>> MarkerOf(const StorePlaces& places,
                                                             const DataDir& data, JobStore* store,
                                                             BlobStore* blobs);
// The same, after InstallationMarker::Claim().
absl::StatusOr<std::unique_ptr<InstallationMarker>> ClaimBlobs(const StorePlaces& places,
                                                               const DataDir& data, JobStore* store,
                                                               BlobStore* blobs);

// Whether the installation may begin to use these blobs; changes neither store. Errors of
// InstallationMarker; FAILED_PRECONDITION (BLOBS_NOT_MARKED) if there is neither a marker nor a
// blob, and the job store names files: a volume is not mounted, say.
absl::Status CheckBlobsAreOurs(const StorePlaces& places, const DataDir& data, BlobStore* blobs);

// Whether both name one database, which is there. Errors of the stores.
absl::StatusOr<bool> AreOneJobStore(const StorePlaces& one, const StorePlaces& other,
                                    const DataDir& data);

// Whether there is a store to begin with, without changing it: a file is read as a whole, unless it
// is not there yet; a database is connected to. DATA_LOSS (STORE_CORRUPT), UNAVAILABLE
// (STORE_UNAVAILABLE), FAILED_PRECONDITION (STORE_TOO_NEW, STORE_TOO_OLD).
absl::Status CheckJobStore(const StorePlaces& places, const DataDir& data);

}  // namespace litags

#endif  // LITAGS_SERVER_STORE_OPEN_STORES_H_
