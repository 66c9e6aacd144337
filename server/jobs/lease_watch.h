#ifndef LITAGS_SERVER_JOBS_LEASE_WATCH_H_
#define LITAGS_SERVER_JOBS_LEASE_WATCH_H_

#include <thread>

#include "engine/core/cancel.h"
#include "server/jobs/leases.h"

namespace litags {

// A thread that takes lost workers' jobs back; see Leases::TakeBackLost(). Workers do the same when
// they look for work: there may be none that does.
class LeaseWatch {
 public:
  // `leases` must outlive this.
  explicit LeaseWatch(Leases* leases);
  ~LeaseWatch();

 private:
  void Loop();

  Leases* const leases_;
  CancelToken stop_;
  std::thread thread_;
};

}  // namespace litags

#endif  // LITAGS_SERVER_JOBS_LEASE_WATCH_H_
