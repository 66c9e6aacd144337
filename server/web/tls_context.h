#ifndef LITAGS_SERVER_WEB_TLS_CONTEXT_H_
#define LITAGS_SERVER_WEB_TLS_CONTEXT_H_

#include <boost/asio/ssl/context.hpp>
#include <memory>

#include "absl/status/statusor.h"
#include "server/auth/tls.h"

namespace litags::web {

// TLS 1.2 or later with these files; with `client_ca`, clients must show a certificate issued by
// one of them. FAILED_PRECONDITION (TLS_FILE_INVALID): OpenSSL does not take them.
absl::StatusOr<std::shared_ptr<boost::asio::ssl::context>> MakeTlsContext(
    const TlsMaterial& material);

}  // namespace litags::web

#endif  // LITAGS_SERVER_WEB_TLS_CONTEXT_H_
