// Jobs as their owners see them: every rule about what may be done when is here and in
// state_machine.h; the API only translates.
#ifndef LITAGS_SERVER_JOBS_JOBS_H_
#define LITAGS_SERVER_JOBS_JOBS_H_

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "engine/pipeline/engine.h"
#include "server/jobs/client_job_store.h"
#include "server/store/blob_store.h"
#include "server/store/data_dir.h"
#include "server/store/job_store.h"

namespace litags {

// Milliseconds since 1970.
using Clock = std::function<int64_t()>;
int64_t SystemClockMs();

// The store key of a job's file or preview picture.
std::string BlobKey(std::string_view job_id, std::string_view sha256);

// What an upload may cost.
struct UploadLimits {
  int64_t max_files = 10000;                      // per job
  int64_t max_file_bytes = int64_t{256} << 20;    // photos and depth maps
  int64_t max_cameras_bytes = int64_t{64} << 20;  // transforms.json
};

// Thread-safe. Errors: those of JobStore and NextState(), and what each call says.
class Jobs {
 public:
  // The stores must outlive this.
  Jobs(JobStore* store, BlobStore* blobs, DataDir data, Clock clock = SystemClockMs)
      : store_(store), blobs_(blobs), data_(std::move(data)), clock_(std::move(clock)) {}

  // The same jobs as one client may see and change them; see ClientJobStore. Must not outlive the
  // stores.
  std::shared_ptr<Jobs> For(ClientView view) const;

  // ALREADY_EXISTS (REQUEST_ID_REUSED) if the id was used for a job of other name or options.
  absl::StatusOr<JobRecord> Create(const std::string& request_id, const std::string& display_name,
                                   const ReconstructOptions& options);

  absl::StatusOr<JobRecord> Get(std::string_view id) { return store_->Get(id); }
  absl::StatusOr<std::vector<JobRecord>> List(int64_t after_time_ms, std::string_view after_id,
                                              int limit) {
    return store_->List(after_time_ms, after_id, limit);
  }

  // OK if the job takes files.
  absl::Status CheckUpload(std::string_view id);
  // Whether the file is stored already, with this content.
  absl::StatusOr<bool> HasFile(std::string_view id, const FileRecord& file);
  // Keeps a checked file whose bytes are at `path`; the file at `path` is consumed. On disk when it
  // returns. RESOURCE_EXHAUSTED (TOO_MANY_FILES).
  absl::Status AddFile(std::string_view id, const FileRecord& file, const std::string& path,
                       const UploadLimits& limits = {});

  // FAILED_PRECONDITION: TOO_FEW_PHOTOS, PHOTO_SIZES_DIFFER, beside the state's own.
  absl::StatusOr<JobRecord> Start(std::string_view id);
  absl::StatusOr<JobRecord> Cancel(std::string_view id);
  absl::StatusOr<JobRecord> Resume(std::string_view id);
  absl::Status Delete(std::string_view id);

  absl::StatusOr<std::vector<EventRecord>> Events(std::string_view id, int64_t after, int limit) {
    return store_->Events(id, after, limit);
  }
  absl::StatusOr<std::string> Preview(std::string_view id, std::string_view sha256) {
    return blobs_->Get(BlobKey(id, sha256));
  }
  absl::StatusOr<int64_t> ChangeToken() { return store_->ChangeToken(); }

  const DataDir& data() const { return data_; }

 private:
  absl::Status Enqueue(JobTransaction& job, std::string_view message);

  JobStore* const store_;
  BlobStore* const blobs_;
  const DataDir data_;
  const Clock clock_;
};

}  // namespace litags

#endif  // LITAGS_SERVER_JOBS_JOBS_H_
