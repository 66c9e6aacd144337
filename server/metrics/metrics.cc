#include "server/metrics/metrics.h"

#include "engine/core/error.h"
#include "server/metrics/families.h"

namespace litags {
namespace {

// From a cached answer to a call that waited its longest, in seconds.
const prometheus::Histogram::BucketBoundaries kSeconds = {
    0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1, 2.5, 5, 10, 30, 60};

constexpr const char* kStoreReasons[] = {"STORE_FAILED", "STORE_CORRUPT",     "DISK_FULL",
                                         "BLOBS_DENIED", "BLOBS_UNAVAILABLE", "BLOB_DAMAGED"};

}  // namespace

Metrics::Families::Families()
    : calls(prometheus::BuildCounter()
                .Name("litags_calls_total")
                .Help("Calls of the API that ended, by method and code")
                .Register(registry)),
      call_seconds(prometheus::BuildHistogram()
                       .Name("litags_call_seconds")
                       .Help("Duration of calls with one answer, their wait included")
                       .Register(registry)),
      picture_seconds(
          prometheus::BuildHistogram()
              .Name("litags_picture_seconds")
              .Help("Time to render and encode a picture, without the wait for its turn")
              .Register(registry)
              .Add({}, kSeconds)),
      uploaded_bytes(prometheus::BuildCounter()
                         .Name("litags_uploaded_bytes_total")
                         .Help("Bytes of files that clients sent")
                         .Register(registry)
                         .Add({})),
      worker_restarts(prometheus::BuildCounter()
                          .Name("litags_worker_restarts_total")
                          .Help("Workers that ended by themselves and were replaced")
                          .Register(registry)
                          .Add({})),
      store_errors(prometheus::BuildCounter()
                       .Name("litags_store_errors_total")
                       .Help("Calls, and looks for metrics and health, that failed in a store")
                       .Register(registry)) {
  // There from the start, so that the first error is an increase.
  for (const char* reason : kStoreReasons) store_errors.Add({{"reason", reason}});
}

Metrics::Metrics() : families_(std::make_shared<Families>()) {}
Metrics::~Metrics() = default;

void Metrics::AddCall(const char* method, absl::StatusCode code, double seconds) {
  families_->calls.Add({{"method", method}, {"code", absl::StatusCodeToString(code)}}).Increment();
  if (seconds < 0) return;
  families_->call_seconds.Add({{"method", method}}, kSeconds).Observe(seconds);
}

void Metrics::AddPicture(double seconds) { families_->picture_seconds.Observe(seconds); }

void Metrics::AddUploadedBytes(int64_t bytes) {
  families_->uploaded_bytes.Increment(static_cast<double>(bytes));
}

void Metrics::AddWorkerRestart() { families_->worker_restarts.Increment(); }

void Metrics::AddIfStoreError(const absl::Status& status) {
  const auto detail = GetErrorDetail(status);
  if (!detail) return;
  for (const char* reason : kStoreReasons) {
    if (detail->reason == reason) families_->store_errors.Add({{"reason", reason}}).Increment();
  }
}

}  // namespace litags
