#ifndef LITAGS_SERVER_AUTH_AUTHENTICATOR_H_
#define LITAGS_SERVER_AUTH_AUTHENTICATOR_H_

#include <chrono>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"
#include "server/auth/file_stamp.h"
#include "server/auth/principal.h"
#include "server/auth/tokens.h"

namespace litags {

struct AuthOptions {
  std::string tokens_path;                 // file of token entries; empty: none
  std::vector<std::string> token_entries;  // more of them
  bool client_certificates = false;        // TLS has verified one for every connection
  std::vector<std::string> admins;         // names of clients that see everybody's jobs

  bool enabled() const {
    return client_certificates || !tokens_path.empty() || !token_entries.empty();
  }
};

// Tells who calls, from what a call carries. Thread-safe and quick. A tokens file that was changed
// is read anew within a second, so that a token can be taken back while the server runs; if the new
// content is not valid, the old one stays in force and the log says so.
class Authenticator {
 public:
  // FAILED_PRECONDITION (TOKENS_UNREADABLE), INVALID_ARGUMENT (TOKEN_ENTRY_INVALID,
  // CLIENT_NAME_INVALID).
  static absl::StatusOr<std::unique_ptr<Authenticator>> Make(AuthOptions options);

  // `authorization`: the value of that header, nullopt if there is none. `certificate_name`: the
  // common name of the verified client certificate, if there is one. A token names the client, else
  // the certificate does; a wrong token is refused whatever the certificate.
  // UNAUTHENTICATED (TOKEN_MISSING, TOKEN_INVALID, CERTIFICATE_NAME_INVALID).
  absl::StatusOr<Principal> Identify(std::optional<std::string_view> authorization,
                                     std::optional<std::string_view> certificate_name);

  // Another number once the tokens have been read anew: whom Identify() knew before, it may not
  // know any more. Looks whether they have to be.
  int64_t Generation();

 private:
  explicit Authenticator(AuthOptions options) : options_(std::move(options)) {}
  absl::Status Load();
  std::shared_ptr<const TokenTable> Tokens();
  Principal Named(std::string name) const;

  const AuthOptions options_;
  std::set<std::string> admins_;
  std::mutex mutex_;
  std::shared_ptr<const TokenTable> tokens_;
  int64_t generation_ = 0;
  FileStamp file_;    // as it was when it was read
  std::string said_;  // why it cannot be read now, said once
  std::chrono::steady_clock::time_point looked_;
};

}  // namespace litags

#endif  // LITAGS_SERVER_AUTH_AUTHENTICATOR_H_
