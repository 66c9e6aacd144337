#include "server/api/credentials.h"

#include <grpc/grpc.h>

#include <string>
#include <utility>

#include "engine/core/check.h"

namespace litags {
namespace {

// Those of gRPC's C interface, which can do more than its C++ interface.
class CoreCredentials : public grpc::ServerCredentials {
 public:
  CoreCredentials(grpc_server_credentials* credentials, grpc_auth_metadata_processor at_headers)
      : credentials_(credentials) {
    grpc_server_credentials_set_auth_metadata_processor(credentials_, at_headers);
  }
  ~CoreCredentials() override { grpc_server_credentials_release(credentials_); }

  // It was set already.
  void SetAuthMetadataProcessor(const std::shared_ptr<grpc::AuthMetadataProcessor>&) override {
    LITAGS_CHECK(false);
  }

 private:
  int AddPortToServer(const std::string& address, grpc_server* server) override {
    return grpc_server_add_http2_port(server, address.c_str(), credentials_);
  }

  grpc_server_credentials* const credentials_;
};

// gRPC's C++ interface takes certificates once, or watches files without a look at what is in them;
// its C interface asks at every handshake.
class RenewingCredentials final : public CoreCredentials {
 public:
  RenewingCredentials(std::unique_ptr<TlsFiles> files, grpc_auth_metadata_processor at_headers)
      : CoreCredentials(grpc_ssl_server_credentials_create_with_options(
                            grpc_ssl_server_credentials_create_options_using_config_fetcher(
                                files->asks_clients()
                                    ? GRPC_SSL_REQUEST_AND_REQUIRE_CLIENT_CERTIFICATE_AND_VERIFY
                                    : GRPC_SSL_DONT_REQUEST_CLIENT_CERTIFICATE,
                                &Fetch, this)),
                        at_headers),
        files_(std::move(files)) {}

 private:
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
};

}  // namespace

std::shared_ptr<grpc::ServerCredentials> TlsCredentials(std::unique_ptr<TlsFiles> files,
                                                        grpc_auth_metadata_processor at_headers) {
  return std::make_shared<RenewingCredentials>(std::move(files), at_headers);
}

std::shared_ptr<grpc::ServerCredentials> PlainCredentials(grpc_auth_metadata_processor at_headers) {
  return std::make_shared<CoreCredentials>(grpc_insecure_server_credentials_create(), at_headers);
}

}  // namespace litags
