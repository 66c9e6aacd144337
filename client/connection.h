// The way to a server: plaintext or TLS, and who we say we are.
#ifndef LITAGS_CLIENT_CONNECTION_H_
#define LITAGS_CLIENT_CONNECTION_H_

#include <memory>
#include <string>

#include "absl/status/statusor.h"
#include "grpcpp/channel.h"

namespace litags::client {

struct ConnectionOptions {
  // host:port, or unix:path on this machine; several, separated by commas, of one service: the
  // first that answers, in an order that is another one in every process, is used until it does not
  // answer any more.
  std::string server = {};
  bool tls = false;  // with the system's root certificates; also turned on by those below
  // Paths of PEM files; empty: none.
  std::string tls_ca = {};    // the roots to trust instead of the system's
  std::string tls_cert = {};  // our certificate, if the server asks for one
  std::string tls_key = {};   // its private key
  std::string tls_name = {};  // what certificates must name; empty: the first host of `server`
  // At most one of them: the token itself, or the file that holds it.
  std::string token = {};
  std::string token_file = {};
  // While a call is open, a server that has been silent for so long is asked whether it is still
  // there, and given up if it does not answer in time; seconds.
  double keepalive_seconds = 30;
  double keepalive_timeout_seconds = 10;
};

// A channel to the server, whose calls carry the token. It says nothing about whether a server is
// there: the first call shows.
//
// INVALID_ARGUMENT, with the flag as the field: SERVER_UNKNOWN (no HOST:PORT; of several, one
// has no address), TLS_FILE_UNREADABLE, TLS_INCOMPLETE, TOKEN_UNREADABLE, TOKEN_INVALID (not a
// token's characters), TOKEN_EXPOSED (it would travel unencrypted to another machine).
absl::StatusOr<std::shared_ptr<grpc::Channel>> Connect(const ConnectionOptions& options);

}  // namespace litags::client

#endif  // LITAGS_CLIENT_CONNECTION_H_
