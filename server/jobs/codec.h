// What the store keeps as JSON: options, progress, errors, reports, event payloads. Unknown keys
// are skipped and missing ones take their default, so that old rows stay readable.
#ifndef LITAGS_SERVER_JOBS_CODEC_H_
#define LITAGS_SERVER_JOBS_CODEC_H_

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "engine/core/error.h"
#include "engine/pipeline/options.h"
#include "engine/pipeline/report.h"
#include "server/jobs/kept_files.h"
#include "server/jobs/labels.h"
#include "server/jobs/placement.h"
#include "server/jobs/policy.h"
#include "server/jobs/webhook.h"
#include "server/store/job_store.h"

namespace litags {

// An error as it is kept with a failed job.
struct JobError {
  absl::StatusCode code = absl::StatusCode::kOk;
  std::string message;
  ErrorDetail detail;

  static JobError Of(const absl::Status& status);
};

// Payload of EventKind::kState.
struct StateChange {
  JobState state = JobState::kUploading;
  std::string message;
  std::optional<JobError> error;
};

// Payload of EventKind::kProgress, and JobRecord::progress. The picture is a blob of its own.
struct ProgressRecord {
  Progress progress;    // preview_png is empty
  std::string preview;  // the PNG, see BlobKey(); empty: none
};

// Payload of EventKind::kSnapshot.
struct SnapshotRecord {
  int iteration = 0;
};

std::string Encode(const ReconstructOptions& options);
std::string Encode(const JobPolicy& policy);
std::string Encode(const Resources& resources);
std::string Encode(const JobError& error);
std::string Encode(const StateChange& change);
std::string Encode(const ProgressRecord& progress);
std::string Encode(const SnapshotRecord& snapshot);
std::string Encode(const ReconstructReport& report);
std::string Encode(const KeptFiles& files);
std::string Encode(const Labels& labels);    // none: empty
std::string Encode(const Webhook& webhook);  // none: empty

// The job has these from now on, and their bytes count as its owner's.
void SetKept(JobRecord* job, const KeptFiles& files);

// Of a job's row. INTERNAL (STORE_CORRUPT).
absl::StatusOr<Labels> LabelsOf(const JobRecord& job);
absl::StatusOr<Webhook> WebhookOf(const JobRecord& job);
// Jobs that were made before there were policies have none.
absl::StatusOr<JobPolicy> PolicyOf(const JobRecord& job);

// Names of the options that differ, as in JobOptions of the proto.
std::vector<std::string> Differences(const ReconstructOptions& a, const ReconstructOptions& b);

// Decode<T>(Encode(x)) == x. INTERNAL (STORE_CORRUPT) if the text is not of this kind.
template <typename T>
absl::StatusOr<T> Decode(std::string_view json);

}  // namespace litags

#endif  // LITAGS_SERVER_JOBS_CODEC_H_
