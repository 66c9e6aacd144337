#ifndef LITAGS_SERVER_API_GRPC_LOG_H_
#define LITAGS_SERVER_API_GRPC_LOG_H_

namespace litags {

// What gRPC says of itself goes to our log from now on, at a bounded rate: strangers make it say
// things, as with a handshake that fails. GRPC_VERBOSITY chooses what it says.
void LogGrpc();

}  // namespace litags

#endif  // LITAGS_SERVER_API_GRPC_LOG_H_
