#ifndef LITAGS_SERVER_JOBS_JANITOR_H_
#define LITAGS_SERVER_JOBS_JANITOR_H_

#include <thread>

#include "engine/core/cancel.h"
#include "server/jobs/jobs.h"

namespace litags {

// A thread that sweeps, at once and then regularly; see Jobs::Sweep().
class Janitor {
 public:
  // `jobs` must outlive this.
  Janitor(Jobs* jobs, double interval_seconds);
  ~Janitor();

 private:
  void Loop(double interval_seconds);

  Jobs* const jobs_;
  CancelToken stop_;
  std::thread thread_;
};

}  // namespace litags

#endif  // LITAGS_SERVER_JOBS_JANITOR_H_
