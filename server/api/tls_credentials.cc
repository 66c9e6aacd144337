#include "server/api/tls_credentials.h"

#include <grpc/grpc.h>
#include <grpc/grpc_security.h>

#include <string>

#include "engine/core/check.h"

namespace litags {
namespace {

// gRPC's C++ interface takes certificates once, or watches files without a look at what is in them;
// its C interface asks at every handshake.
class RenewingCredentials final : public grpc::ServerCredentials {
 public:
  explicit RenewingCredentials(std::unique_ptr<TlsFiles> files) : files_(std::move(files)) {
    credentials_ = grpc_ssl_server_credentials_create_with_options(
        grpc_ssl_server_credentials_create_options_using_config_fetcher(
            files_->asks_clients() ? GRPC_SSL_REQUEST_AND_REQUIRE_CLIENT_CERTIFICATE_AND_VERIFY
                                   : GRPC_SSL_DONT_REQUEST_CLIENT_CERTIFICATE,
            &Fetch, this));
  }
  ~RenewingCredentials() override { grpc_server_credentials_release(credentials_); }

  // Callers are identified in Gate.
  void SetAuthMetadataProcessor(const std::shared_ptr<grpc::AuthMetadataProcessor>&) override {
    LITAGS_CHECK(false);
  }

 private:
  int AddPortToServer(const std::string& address, grpc_server* server) override {
    return grpc_server_add_http2_port(server, address.c_str(), credentials_);
  }

  static grpc_ssl_certificate_config_reload_status Fetch(
      void* self, grpc_ssl_server_certificate_config** config) {
    const auto renewed = static_cast<RenewingCredentials*>(self)->files_->TakeRenewed();
    if (!renewed) return GRPC_SSL_CERTIFICATE_CONFIG_RELOAD_UNCHANGED;
    const grpc_ssl_pem_key_cert_pair pair = {renewed->key.c_str(), renewed->cert.c_str()};
    // gRPC 1.51 insists on some authority, also where clients are not asked for certificates.
    const std::string& client_ca = renewed->client_ca.empty() ? renewed->cert : renewed->client_ca;
    *config = grpc_ssl_server_certificate_config_create(client_ca.c_str(), &pair, 1);
    return GRPC_SSL_CERTIFICATE_CONFIG_RELOAD_NEW;
  }

  const std::unique_ptr<TlsFiles> files_;
  grpc_server_credentials* credentials_;
};

}  // namespace

std::shared_ptr<grpc::ServerCredentials> TlsCredentials(std::unique_ptr<TlsFiles> files) {
  return std::make_shared<RenewingCredentials>(std::move(files));
}

}  // namespace litags
