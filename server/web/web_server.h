// The page in the browser and the services by HTTP.
#ifndef LITAGS_SERVER_WEB_WEB_SERVER_H_
#define LITAGS_SERVER_WEB_WEB_SERVER_H_

#include <grpcpp/channel.h>

#include <memory>
#include <string>

#include "absl/status/statusor.h"
#include "server/auth/tls.h"
#include "server/net/connections.h"
#include "server/net/shared_room.h"

namespace litags::web {

struct WebOptions {
  std::string listen;  // HOST:PORT; port 0: any free one
  TlsOptions tls;      // none: plaintext
  ConnectionCounts counts{.max_connections = 256, .max_newcomers = 128};
  // Nobody is asked who they are: requests must name this machine itself.
  bool local_only = false;
  double keepalive_timeout_seconds = 20;  // until a peer that acknowledges nothing is given up
  double silence_seconds = 60;            // between two pieces of an upload
  double unread_seconds = 60;             // until an answer is read, and one more for each MiB
};

class WebServer {
 public:
  // `channel` leads to the services, `unread` counts what clients have not read of their answers
  // and must outlive this. Errors of LoadTls(); UNAVAILABLE (CANNOT_LISTEN).
  static absl::StatusOr<std::unique_ptr<WebServer>> Start(const WebOptions& options,
                                                          std::shared_ptr<grpc::Channel> channel,
                                                          SharedRoom* unread);
  ~WebServer();  // Stop()

  int port() const;
  // http://HOST:PORT, for people on this machine.
  std::string url() const;
  // Cuts all connections. Call it before the services end.
  void Stop();

 private:
  struct Parts;
  explicit WebServer(std::unique_ptr<Parts> parts);
  std::unique_ptr<Parts> parts_;
};

}  // namespace litags::web

#endif  // LITAGS_SERVER_WEB_WEB_SERVER_H_
