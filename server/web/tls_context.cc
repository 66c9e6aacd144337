#include "server/web/tls_context.h"

#include <openssl/ssl.h>

#include <boost/asio/buffer.hpp>
#include <string_view>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"

namespace litags::web {
namespace {

namespace asio = boost::asio;
namespace ssl = boost::asio::ssl;

// A session is resumed in its own context only. Without a name OpenSSL refuses to resume where
// clients show certificates, and ends the connection.
constexpr std::string_view kSessions = "litags page";

absl::Status Refused(std::string_view flag, const boost::system::error_code& error) {
  return MakeError(
      absl::StatusCode::kFailedPrecondition, "TLS_FILE_INVALID", flag,
      absl::StrCat("OpenSSL does not take the file of ", std::string(flag), ": ", error.message()));
}

}  // namespace

absl::StatusOr<std::shared_ptr<ssl::context>> MakeTlsContext(const TlsMaterial& material) {
  auto context = std::make_shared<ssl::context>(ssl::context::tls_server);
  boost::system::error_code error;
  context->set_options(ssl::context::default_workarounds | ssl::context::no_sslv2 |
                           ssl::context::no_sslv3 | ssl::context::no_tlsv1 |
                           ssl::context::no_tlsv1_1,
                       error);
  context->use_certificate_chain(asio::buffer(material.cert), error);
  if (error) return Refused("--tls-cert", error);
  context->use_private_key(asio::buffer(material.key), ssl::context::pem, error);
  if (error) return Refused("--tls-key", error);
  if (!material.client_ca.empty()) {
    context->add_certificate_authority(asio::buffer(material.client_ca), error);
    if (error) return Refused("--tls-client-ca", error);
    context->set_verify_mode(ssl::verify_peer | ssl::verify_fail_if_no_peer_cert, error);
    if (error) return Refused("--tls-client-ca", error);
    SSL_CTX_set_session_id_context(context->native_handle(),
                                   reinterpret_cast<const unsigned char*>(kSessions.data()),
                                   static_cast<unsigned>(kSessions.size()));
  }
  return context;
}

}  // namespace litags::web
