// Calls before they have come whole: gRPC shows a handler nothing until then.
#ifndef LITAGS_SERVER_API_CALL_DOOR_H_
#define LITAGS_SERVER_API_CALL_DOOR_H_

#include <grpc/grpc_security.h>
#include <grpcpp/server_context.h>
#include <grpcpp/support/server_interceptor.h>

#include <cstdint>
#include <memory>
#include <mutex>

#include "server/auth/authenticator.h"
#include "server/net/connections.h"

namespace litags {

// Counts the calls of each connection from their headers to their end, and refuses those that are
// too many, by which gRPC forgets them: with UNAVAILABLE, which clients try again, as no details
// could tell them to. gRPC's own limit of calls binds only peers that acknowledge its settings.
// Thread-safe.
class CallDoor {
 public:
  // Both must outlive this, and this the server.
  CallDoor(Authenticator* authenticator, Connections* connections)
      : authenticator_(authenticator), connections_(connections) {}

  // To be set in the server's credentials: sees the headers of each call.
  grpc_auth_metadata_processor AtHeaders();
  // To be given to the server's builder: sees each call when it has come whole, and its end.
  std::unique_ptr<grpc::experimental::ServerInterceptorFactoryInterface> WhenWhole();

 private:
  bool LetIn(grpc_auth_context* context, const grpc_metadata* headers, size_t count);
  uint64_t NumberOf(grpc_auth_context* context);

  Authenticator* const authenticator_;
  Connections* const connections_;
  std::mutex mutex_;
  uint64_t last_number_ = 0;
};

// The connection that a call came on, as Connections count it; 0: none, as in process.
uint64_t ConnectionNumber(const grpc::ServerContextBase& context);

}  // namespace litags

#endif  // LITAGS_SERVER_API_CALL_DOOR_H_
