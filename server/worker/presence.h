#ifndef LITAGS_SERVER_WORKER_PRESENCE_H_
#define LITAGS_SERVER_WORKER_PRESENCE_H_

#include <string>
#include <thread>

#include "engine/core/cancel.h"
#include "server/jobs/placement.h"
#include "server/store/job_store.h"

namespace litags {

// Says that a worker is there, and what it has, for as long as this lives. A store that is away is
// told later.
class WorkerPresence {
 public:
  // `store` must outlive this.
  WorkerPresence(JobStore* store, std::string name, const Resources& has);
  ~WorkerPresence();

 private:
  void Loop();

  JobStore* const store_;
  const std::string name_, resources_;
  CancelToken stop_;
  std::thread thread_;
};

}  // namespace litags

#endif  // LITAGS_SERVER_WORKER_PRESENCE_H_
