#ifndef LITAGS_SERVER_JOBS_JANITOR_H_
#define LITAGS_SERVER_JOBS_JANITOR_H_

#include <thread>

#include "engine/core/cancel.h"
#include "server/jobs/sweeper.h"

namespace litags {

// A thread that sweeps, at once and then regularly; see Sweeper.
class Janitor {
 public:
  // `sweeper` must outlive this.
  Janitor(Sweeper* sweeper, double interval_seconds);
  ~Janitor();

 private:
  void Loop(double interval_seconds);

  Sweeper* const sweeper_;
  CancelToken stop_;
  std::thread thread_;
};

}  // namespace litags

#endif  // LITAGS_SERVER_JOBS_JANITOR_H_
