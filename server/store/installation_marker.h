#ifndef LITAGS_SERVER_STORE_INSTALLATION_MARKER_H_
#define LITAGS_SERVER_STORE_INSTALLATION_MARKER_H_

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "server/store/blob_store.h"

namespace litags {

// The blob "installation/ID", which says whose blobs a store holds. Two job stores on one blob
// store would remove each other's blobs as orphan blobs.
//
// Errors: FAILED_PRECONDITION (BLOBS_OF_ANOTHER_INSTALLATION), and those of the blob store.
// Thread-safe.
class InstallationMarker {
 public:
  // `id`: JobStore::InstallationId(), or empty where that is not made yet. `place`: the blob
  // store's URL, for the operator. `blobs` must outlive this.
  InstallationMarker(std::string id, std::string place, BlobStore* blobs);

  // Puts the marker if there is none.
  absl::Status Claim() const;
  // Whether the marker is there, and no other installation's. FAILED_PRECONDITION
  // (BLOBS_NOT_MARKED).
  absl::Status Check() const;

 private:
  absl::Status CheckOthers(const std::vector<std::string>& ids) const;

  const std::string id_;
  const std::string place_;
  BlobStore* const blobs_;
};

}  // namespace litags

#endif  // LITAGS_SERVER_STORE_INSTALLATION_MARKER_H_
