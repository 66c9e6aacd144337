#ifndef LITAGS_SERVER_WORKER_WORK_FOLDER_H_
#define LITAGS_SERVER_WORKER_WORK_FOLDER_H_

#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "engine/core/cancel.h"
#include "server/jobs/kept_files.h"
#include "server/jobs/leases.h"
#include "server/worker/scratch_folder.h"

namespace litags {

// Where the engine works under one lease: a scratch folder of this machine with input/ and run/.
// What earlier leases kept is brought in, and what the engine leaves is brought into the blob
// store. Store() and RemoveReplaced() are for one thread; files may be replaced, as the engine
// does, at any time.
class WorkFolder {
 public:
  // `blobs` must outlive this.
  static absl::StatusOr<std::unique_ptr<WorkFolder>> Make(const Lease& lease, BlobStore* blobs,
                                                          const std::string& scratch_root);

  std::string input() const { return scratch_->path() + "/input"; }
  std::string run() const { return scratch_->path() + "/run"; }

  // Once, before the engine runs. A kept file that is gone or damaged is left out: the engine can
  // do without any. Errors of the blob store; CANCELLED before the next file once `cancel` is
  // raised.
  absl::Status Fetch(const CancelToken& cancel = {});

  // Stores the files that are new or were replaced since the last call; those in `but` at another
  // time. What is gone is not kept any more. After an error of the blob store, what was stored by
  // then is kept, and is not stored again. Returns whether kept() has changed since the last call
  // that succeeded.
  absl::StatusOr<bool> Store(const std::vector<std::string>& but = {});
  const KeptFiles& kept() const { return kept_; }
  // Bytes that Store() sent to the blob store.
  int64_t stored_bytes() const { return stored_bytes_; }

  // Once the job's row names kept(): removes the blobs that it named before.
  void RemoveReplaced();

 private:
  WorkFolder(const Lease& lease, BlobStore* blobs, std::unique_ptr<ScratchFolder> scratch)
      : lease_(lease), blobs_(blobs), scratch_(std::move(scratch)) {}

  const Lease& lease_;
  BlobStore* const blobs_;
  const std::unique_ptr<ScratchFolder> scratch_;
  KeptFiles kept_;
  bool changed_ = false;                   // kept_, since a Store() that succeeded
  std::map<std::string, int64_t> stamps_;  // of the files as they were stored, by name
  std::vector<std::string> replaced_;      // blobs
  int64_t stored_bytes_ = 0;
};

}  // namespace litags

#endif  // LITAGS_SERVER_WORKER_WORK_FOLDER_H_
