#ifndef LITAGS_SERVER_API_SERVER_H_
#define LITAGS_SERVER_API_SERVER_H_

#include <grpcpp/channel.h>

#include <memory>
#include <string>

#include "absl/status/statusor.h"
#include "engine/pipeline/engine.h"
#include "server/api/render_service.h"
#include "server/jobs/jobs.h"

namespace litags {

struct ServerOptions {
  std::string listen =
      "127.0.0.1:50051";   // host:port; port 0: any free one; empty: in process only
  int store_threads = 4;   // for calls about jobs
  int render_threads = 2;  // pictures made at the same time
  size_t max_waiting_calls = 1024;
  size_t max_waiting_pictures = 32;
  RenderLimits render;
};

// The gRPC services on one port, with health and reflection.
class Server {
 public:
  virtual ~Server() = default;  // Shutdown()

  // The port it listens on; 0 if it listens on none.
  virtual int port() const = 0;
  virtual std::shared_ptr<grpc::Channel> InProcessChannel() = 0;

  // Ends watches with UNAVAILABLE, gives other calls a moment, then ends them too.
  virtual void Shutdown() = 0;
};

// Both must outlive the server. UNAVAILABLE (CANNOT_LISTEN).
absl::StatusOr<std::unique_ptr<Server>> StartServer(const ServerOptions& options, Jobs* jobs,
                                                    Engine* engine);

}  // namespace litags

#endif  // LITAGS_SERVER_API_SERVER_H_
