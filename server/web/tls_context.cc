#include "server/web/tls_context.h"

#include <boost/asio/buffer.hpp>

namespace litags::web {

namespace asio = boost::asio;
namespace ssl = boost::asio::ssl;

std::shared_ptr<ssl::context> MakeTlsContext(const TlsMaterial& material) {
  auto context = std::make_shared<ssl::context>(ssl::context::tls_server);
  context->set_options(ssl::context::default_workarounds | ssl::context::no_sslv2 |
                       ssl::context::no_sslv3 | ssl::context::no_tlsv1 | ssl::context::no_tlsv1_1);
  context->use_certificate_chain(asio::buffer(material.cert));
  context->use_private_key(asio::buffer(material.key), ssl::context::pem);
  if (!material.client_ca.empty()) {
    context->add_certificate_authority(asio::buffer(material.client_ca));
    context->set_verify_mode(ssl::verify_peer | ssl::verify_fail_if_no_peer_cert);
  }
  return context;
}

}  // namespace litags::web
