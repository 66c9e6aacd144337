#ifndef LITAGS_SERVER_WEB_TLS_CONTEXT_H_
#define LITAGS_SERVER_WEB_TLS_CONTEXT_H_

#include <boost/asio/ssl/context.hpp>
#include <memory>

#include "server/auth/tls.h"

namespace litags::web {

// TLS 1.2 or later with these files; with `client_ca`, clients must show a certificate issued by
// one of them.
std::shared_ptr<boost::asio::ssl::context> MakeTlsContext(const TlsMaterial& material);

}  // namespace litags::web

#endif  // LITAGS_SERVER_WEB_TLS_CONTEXT_H_
