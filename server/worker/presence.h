#ifndef LITAGS_SERVER_WORKER_PRESENCE_H_
#define LITAGS_SERVER_WORKER_PRESENCE_H_

#include <condition_variable>
#include <mutex>
#include <stop_token>
#include <string>
#include <thread>

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
  void Loop(std::stop_token stop);

  JobStore* const store_;
  const std::string name_, resources_;
  std::mutex mutex_;
  std::condition_variable_any wake_;
  std::jthread thread_;
};

}  // namespace litags

#endif  // LITAGS_SERVER_WORKER_PRESENCE_H_
