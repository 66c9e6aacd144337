#ifndef LITAGS_SERVER_WORKER_SHUTDOWN_SIGNAL_H_
#define LITAGS_SERVER_WORKER_SHUTDOWN_SIGNAL_H_

#include "engine/core/cancel.h"

namespace litags {

// Turns SIGTERM, SIGINT and SIGHUP into a cancel token while it lives; SIGHUP not where it is
// ignored, as nohup does. SIGPIPE is ignored: a log that nobody reads any more ends no process.
// Make it before other threads start.
class ShutdownSignal {
 public:
  ShutdownSignal();
  ~ShutdownSignal();
  ShutdownSignal(const ShutdownSignal&) = delete;
  ShutdownSignal& operator=(const ShutdownSignal&) = delete;

  const CancelToken& token() const;
  // Returns once a signal came.
  void Wait() const;
};

}  // namespace litags

#endif  // LITAGS_SERVER_WORKER_SHUTDOWN_SIGNAL_H_
