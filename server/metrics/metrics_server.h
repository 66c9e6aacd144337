#ifndef LITAGS_SERVER_METRICS_METRICS_SERVER_H_
#define LITAGS_SERVER_METRICS_METRICS_SERVER_H_

#include <memory>
#include <string>

#include "absl/status/statusor.h"
#include "server/metrics/metrics.h"
#include "server/store/job_store.h"

namespace litags {

// Answers GET /metrics in Prometheus' text format. Plain HTTP, and everybody who reaches the
// address is answered.
class MetricsServer {
 public:
  // `listen`: HOST:PORT, port 0: any free one. Jobs are looked at in each request; if that fails,
  // litags_store_up is 0 and their gauges are left out, not out of date. Both must outlive this.
  // UNAVAILABLE (CANNOT_LISTEN).
  static absl::StatusOr<std::unique_ptr<MetricsServer>> Start(const std::string& listen,
                                                              Metrics* metrics, JobStore* store);
  ~MetricsServer();

  int port() const;

 private:
  struct Http;
  explicit MetricsServer(std::unique_ptr<Http> http);

  const std::unique_ptr<Http> http_;
};

}  // namespace litags

#endif  // LITAGS_SERVER_METRICS_METRICS_SERVER_H_
