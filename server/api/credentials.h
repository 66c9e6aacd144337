#ifndef LITAGS_SERVER_API_CREDENTIALS_H_
#define LITAGS_SERVER_API_CREDENTIALS_H_

#include <grpc/grpc_security.h>
#include <grpcpp/security/server_credentials.h>

#include <memory>

#include "server/auth/tls.h"

namespace litags {

// Both show the headers of each call to `at_headers`, before its message has come.

// Handshakes with what `files` hold at the moment. Connections that are open stay so.
std::shared_ptr<grpc::ServerCredentials> TlsCredentials(std::unique_ptr<TlsFiles> files,
                                                        grpc_auth_metadata_processor at_headers);
// Without TLS.
std::shared_ptr<grpc::ServerCredentials> PlainCredentials(grpc_auth_metadata_processor at_headers);

}  // namespace litags

#endif  // LITAGS_SERVER_API_CREDENTIALS_H_
