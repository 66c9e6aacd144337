// Jobs as their owners see them: every rule about what may be done when is here and in
// state_machine.h; the API only translates.
#ifndef LITAGS_SERVER_JOBS_JOBS_H_
#define LITAGS_SERVER_JOBS_JOBS_H_

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "absl/functional/function_ref.h"
#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "engine/core/cancel.h"
#include "engine/pipeline/options.h"
#include "server/jobs/caps.h"
#include "server/jobs/client_job_store.h"
#include "server/jobs/kept_files.h"
#include "server/jobs/labels.h"
#include "server/jobs/placement.h"
#include "server/jobs/policy.h"
#include "server/jobs/resume.h"
#include "server/jobs/state_machine.h"
#include "server/jobs/uploads.h"
#include "server/jobs/webhook.h"
#include "server/store/blob_store.h"
#include "server/store/data_dir.h"
#include "server/store/job_store.h"

namespace litags {

// What CreateJob says about a job beside how to reconstruct.
struct NewJob {
  std::string request_id;  // empty: none
  std::string display_name;
  std::string content_digest;  // of what will be uploaded, hex; empty: not said
  ReconstructOptions options;
  JobPolicy policy;
  // Of the request as it was sent; empty: requests are compared by what they made.
  std::string request_digest = {};
  std::string clone_source = {};  // id of the job that is cloned; empty: none
  Labels labels = {};
  Webhook webhook = {};
};

// What a client may change of a job in any state.
struct JobDetails {
  std::string display_name;
  Labels labels;
  int priority = 0;
  double retention_seconds = 0;
  std::vector<std::string> worker_labels = {};
};

// Of what JobDetails has and of the state: other than before once one of them is.
std::string EtagOf(const JobRecord& job);

// Thread-safe. Errors: those of JobStore and NextState(), and what each call says.
class Jobs {
 public:
  // Of all clients. The stores must outlive this. One per data folder; For() makes more of it.
  // Without a clock, the store's is used.
  Jobs(ClientStore* store, BlobStore* blobs, DataDir data, Clock clock = nullptr,
       UploadLimits limits = {}, WebhookPolicy webhooks = {})
      : Jobs(store, blobs, data, clock ? clock : StoreClock(store),
             std::make_shared<UploadArea>(data.uploads(), blobs, limits), {}, webhooks) {}

  // The same jobs as one client may see and change them; see ClientJobStore. Must not outlive the
  // stores.
  std::shared_ptr<Jobs> For(ClientView view) const;

  // The job that this client's same call made before; nullopt: none, or not the same.
  absl::StatusOr<std::optional<JobRecord>> MadeBy(const std::string& request_id,
                                                  const std::string& request_digest);

  // The job that the same request made before, whatever has changed since.
  // ALREADY_EXISTS (REQUEST_ID_REUSED) if the id was used for another request; errors of
  // JobCaps::Check().
  absl::StatusOr<JobRecord> Create(const NewJob& job);

  // A new job with the files of another one of the same owner. ABORTED (CLONED_FILE_GONE): one of
  // them was deleted meanwhile; PERMISSION_DENIED (NOT_YOUR_JOB): it is another client's, which
  // only an administrator sees. And as Create(), but that a priority or run time of the other job
  // that is more than the client may ask for becomes the most that it may. CANCELLED between two
  // files; the same request_id goes on.
  absl::StatusOr<JobRecord> Clone(std::string_view id, const NewJob& job,
                                  const CancelToken& cancel = {});

  absl::StatusOr<JobRecord> Get(std::string_view id) { return store_->Get(id); }
  absl::StatusOr<std::vector<JobRecord>> List(int64_t after_time_ms, std::string_view after_id,
                                              int limit,
                                              ListOrder order = ListOrder::kNewestFirst) {
    return store_->List(after_time_ms, after_id, limit, std::nullopt, order);
  }
  absl::Status CheckWritable() { return store_->CheckWritable(); }
  absl::StatusOr<std::vector<FileRecord>> Files(std::string_view id) { return store_->Files(id); }
  // Of all clients: see QueuePositions().
  absl::StatusOr<JobQueue> Queue() { return store_->Queue(); }
  absl::StatusOr<OwnerUsage> UsageOf(std::string_view owner) { return store_->UsageOf(owner); }

  // ABORTED (ETAG_MISMATCH) if `etag` is neither empty nor the job's, and the change is one; errors
  // of `change`, which may be called more than once, of CheckLabels(), JobPolicy::Validate() and
  // JobCaps.
  using DetailsChange = absl::FunctionRef<absl::Status(JobDetails&)>;
  absl::StatusOr<JobRecord> Update(std::string_view id, std::string_view etag,
                                   DetailsChange change);

  // The workers that are there, all clients' alike; see WaitsFor().
  absl::StatusOr<Workforce> Workers() { return WorkersThere(store_); }

  // Files for jobs that are not started yet.
  Uploads& uploads() { return uploads_; }

  // FAILED_PRECONDITION: DEPTH_MODEL_MISSING, JOB_WITHOUT_PROGRESS (its last thousand events show
  // none), beside the state's own. Errors of CheckFiles() and JobCaps::Check().
  // With the request_id of the call that queued the job last it changes nothing, as Resume().
  absl::StatusOr<JobRecord> Start(std::string_view id, const std::string& request_id = "");
  absl::StatusOr<JobRecord> Cancel(std::string_view id);
  // Errors of `change`, of ResumedOptions(), and those of Start().
  absl::StatusOr<JobRecord> Resume(std::string_view id, const ResumeChange& change = nullptr,
                                   const std::string& request_id = "");
  absl::Status Delete(std::string_view id);

  absl::StatusOr<std::vector<EventRecord>> Events(std::string_view id, int64_t after, int limit) {
    return store_->Events(id, after, limit);
  }
  absl::StatusOr<std::vector<LogEntry>> Log(std::string_view id, int64_t after, int limit) {
    return store_->Log(id, after, limit);
  }
  absl::StatusOr<std::string> Preview(std::string_view id, std::string_view blob) {
    return blobs_->Get(BlobKey(id, blob));
  }
  // The newest snapshot as the job's row names it; nullopt if there is none.
  static absl::StatusOr<std::optional<KeptFile>> SceneOf(const JobRecord& job);
  // Makes a file of a job readable at `path`, which must not exist and must not be written to.
  absl::Status FetchKept(std::string_view id, const KeptFile& file, const std::string& path) {
    return blobs_->Fetch(BlobKey(id, file.blob), path);
  }
  // As JobStore::WaitForChange(), of any job.
  absl::StatusOr<int64_t> WaitForChange(int64_t seen, double seconds) {
    return store_->WaitForChange(ChangeTopic::kJobs, seen, seconds);
  }

  const DataDir& data() const { return data_; }
  const JobCaps& caps() const { return view_.caps; }

 private:
  Jobs(ClientStore* store, BlobStore* blobs, DataDir data, Clock clock,
       std::shared_ptr<UploadArea> area, ClientView view, WebhookPolicy webhooks)
      : store_(store),
        blobs_(blobs),
        data_(std::move(data)),
        clock_(std::move(clock)),
        uploads_(store, blobs, std::move(area), clock_, view.max_bytes),
        view_(std::move(view)),
        webhooks_(std::move(webhooks)) {}

  // Whether the job may be queued once more: no loop of calls makes its events grow for ever.
  absl::Status CheckProgress(std::string_view id, const std::string& request_id);
  absl::Status Enqueue(JobTransaction& job, JobAction action, std::string_view message);

  ClientStore* const store_;
  BlobStore* const blobs_;
  const DataDir data_;
  const Clock clock_;
  Uploads uploads_;
  const ClientView view_;  // of all jobs: no client's, without limits
  const WebhookPolicy webhooks_;
};

}  // namespace litags

#endif  // LITAGS_SERVER_JOBS_JOBS_H_
