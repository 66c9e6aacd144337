#ifndef LITAGS_SERVER_API_SERVER_H_
#define LITAGS_SERVER_API_SERVER_H_

#include <grpcpp/channel.h>

#include <memory>
#include <string>
#include <string_view>

#include "absl/status/statusor.h"
#include "engine/pipeline/engine.h"
#include "proto/litags/v1/limits.h"
#include "server/api/cpu_budget.h"
#include "server/api/gate.h"
#include "server/api/render_service.h"
#include "server/auth/authenticator.h"
#include "server/auth/tls.h"
#include "server/jobs/jobs.h"
#include "server/metrics/metrics.h"
#include "server/net/connections.h"
#include "server/net/shared_room.h"
#include "server/reader/file_reader.h"

namespace litags {

// What one connection may cost. Times in seconds.
struct ConnectionLimits {
  int max_receive_bytes = 2 * v1::kMaxChunkBytes;  // a message: hardly more than a chunk
  int max_send_bytes = v1::kMaxAnswerBytes;
  int max_header_bytes = 16 << 10;  // all headers of a call
  // What gRPC should hold of requests on their way. Beyond, it cuts off whomever it meets first;
  // it holds more all the same, see docs/adr/0005-own-listener.md.
  size_t max_memory_bytes = size_t{256} << 20;
  ConnectionCounts counts;
  int max_calls = 1000;           // at the same time on one connection
  double keepalive_seconds = 30;  // a silent peer is asked this often whether it is there
  double keepalive_timeout_seconds = 20;
  double min_ping_seconds = 10;    // a peer that asks us more often is cut off
  double max_idle_seconds = 1800;  // a connection without calls is closed
  double max_wait_seconds = 60;    // a call with one answer; longer deadlines are cut to this
};

struct ServerOptions {
  std::string listen =
      "127.0.0.1:50051";  // host:port; port 0: any free one; empty: in process only
  bool insecure = false;  // listen for others without TLS, or without knowing who calls
  TlsOptions tls;         // none: plaintext
  AuthOptions auth;       // client_certificates follows from tls
  ClientLimits limits;
  RequestLimits requests;
  AnswerLimits answers;
  UploadCpuLimits upload_cpu;
  ConnectionLimits connections;
  int store_threads = 4;   // for calls about jobs
  int blob_threads = 4;    // for what may take long: uploads, previews, removal
  int render_threads = 2;  // pictures made at the same time
  size_t max_waiting_calls = 1024;
  size_t max_waiting_pictures = 32;
  RenderLimits render;
  int64_t scene_cache_bytes = int64_t{1} << 30;
  FileReader* reader = nullptr;  // of what clients upload; must outlive the server; null: a new one
                                 // that reads in this process
};

// What the services need. Pictures and models need the store only.
struct Health {
  bool store = true;
  bool workers = true;
};

// The gRPC services on one port, with health and reflection.
class Server {
 public:
  virtual ~Server() = default;  // Shutdown()

  // The port it listens on; 0 if it listens on none.
  virtual int port() const = 0;
  // HOST:PORT by which this machine reaches it; empty if it does not listen on a port.
  virtual std::string own_address() const = 0;
  virtual std::shared_ptr<grpc::Channel> InProcessChannel() = 0;
  // Bytes of answers that clients have not read yet; lives as long as the server. Who calls in
  // process adds what it holds for a client, whom kRoomOfHeader names.
  virtual SharedRoom* unread() = 0;
  // What it counted so far; lives as long as the server.
  virtual Metrics* metrics() = 0;

  // What the health service says from now on: of each service, and, as "", of all together.
  // Thread-safe, but not beside Shutdown().
  virtual void SetHealth(const Health& health) = 0;

  // Ends watches with UNAVAILABLE, gives other calls a moment, then ends them too.
  virtual void Shutdown() = 0;
};

// OK if those who can reach the address are meant to: anything but this machine needs TLS and
// authentication, or `insecure`. FAILED_PRECONDITION (PLAINTEXT_NOT_ASKED_FOR, NOBODY_IS_ASKED).
absl::Status CheckListening(const ServerOptions& options);
// The same for `listen`, another address of the server, which the setting `flag` has.
absl::Status CheckListening(const ServerOptions& options, const std::string& listen,
                            std::string_view flag);
// The same for --metrics-listen, which never encrypts and asks nobody who it is.
absl::Status CheckMetricsListening(const std::string& listen, bool insecure);

// Both must outlive the server. UNAVAILABLE (CANNOT_LISTEN); errors of CheckListening(), LoadTls()
// and Authenticator::Make().
absl::StatusOr<std::unique_ptr<Server>> StartServer(const ServerOptions& options, Jobs* jobs,
                                                    Engine* engine);

}  // namespace litags

#endif  // LITAGS_SERVER_API_SERVER_H_
