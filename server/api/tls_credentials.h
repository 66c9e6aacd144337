#ifndef LITAGS_SERVER_API_TLS_CREDENTIALS_H_
#define LITAGS_SERVER_API_TLS_CREDENTIALS_H_

#include <grpcpp/security/server_credentials.h>

#include <memory>

#include "server/auth/tls.h"

namespace litags {

// Handshakes with what `files` hold at the moment. Connections that are open stay so.
std::shared_ptr<grpc::ServerCredentials> TlsCredentials(std::unique_ptr<TlsFiles> files);

}  // namespace litags

#endif  // LITAGS_SERVER_API_TLS_CREDENTIALS_H_
