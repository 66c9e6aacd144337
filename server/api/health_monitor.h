#ifndef LITAGS_SERVER_API_HEALTH_MONITOR_H_
#define LITAGS_SERVER_API_HEALTH_MONITOR_H_

#include <functional>
#include <thread>
#include <vector>

#include "absl/status/status.h"
#include "engine/core/cancel.h"
#include "server/api/server.h"
#include "server/jobs/jobs.h"
#include "server/store/open_stores.h"

namespace litags {

using LocalFolders = std::vector<StorePlaces::Folder>;

// OK if jobs can be read and changed, and the folders can take more. The store's own errors;
// RESOURCE_EXHAUSTED (DISK_FULL), FAILED_PRECONDITION (STORE_READ_ONLY).
absl::Status CheckStoreHealth(Jobs* jobs, const LocalFolders& folders);

// A thread that looks after the store and the workers, at once and then regularly, and tells the
// server, whose health service tells others. What changes is logged.
class HealthMonitor {
 public:
  // `workers_fail`: whether there are workers and none of them lasts. All must outlive this.
  HealthMonitor(Jobs* jobs, LocalFolders folders, std::function<bool()> workers_fail,
                Server* server, double interval_seconds = 1);
  ~HealthMonitor();

 private:
  void Loop(double interval_seconds);
  void Look();

  Jobs* const jobs_;
  const LocalFolders folders_;
  const std::function<bool()> workers_fail_;
  Server* const server_;
  Health last_;
  CancelToken stop_;
  std::thread thread_;
};

}  // namespace litags

#endif  // LITAGS_SERVER_API_HEALTH_MONITOR_H_
