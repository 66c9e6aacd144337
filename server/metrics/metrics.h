#ifndef LITAGS_SERVER_METRICS_METRICS_H_
#define LITAGS_SERVER_METRICS_METRICS_H_

#include <cstdint>
#include <memory>

#include "absl/status/status.h"

namespace litags {

// What a server counts from its start on, under the names of docs/operations.md. Thread-safe.
class Metrics {
 public:
  Metrics();
  ~Metrics();

  // A call of the API ended; `seconds` < 0: its duration says nothing, as that of a stream.
  void AddCall(const char* method, absl::StatusCode code, double seconds);
  // A picture was made; without the wait for its turn.
  void AddPicture(double seconds);
  void AddUploadedBytes(int64_t bytes);
  // A worker ended by itself and is replaced.
  void AddWorkerRestart();
  // The error, if it is one of the stores that docs/operations.md names.
  void AddIfStoreError(const absl::Status& status);

 private:
  friend class MetricsServer;
  struct Families;
  const std::shared_ptr<Families> families_;
};

}  // namespace litags

#endif  // LITAGS_SERVER_METRICS_METRICS_H_
