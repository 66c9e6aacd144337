#ifndef LITAGS_SERVER_AUTH_TLS_H_
#define LITAGS_SERVER_AUTH_TLS_H_

#include <array>
#include <chrono>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

#include "absl/status/statusor.h"
#include "server/auth/file_stamp.h"

namespace litags {

// Paths of PEM files.
struct TlsOptions {
  std::string cert;       // the server's certificate, then those of its issuers
  std::string key;        // its private key, not encrypted
  std::string client_ca;  // if given, clients must show a certificate issued by one of these

  bool enabled() const { return !cert.empty() || !key.empty() || !client_ca.empty(); }
};

// The files' content.
struct TlsMaterial {
  std::string cert, key, client_ca;
  std::string expires;  // end of the server certificate's life, for humans
};

// Reads and checks the files: that they are there, that every certificate in them can be read, that
// key and certificate belong together, that OpenSSL serves them, and that the certificate is in
// force. FAILED_PRECONDITION, with the flag as the
// field: TLS_INCOMPLETE, TLS_FILE_UNREADABLE, TLS_FILE_INVALID, TLS_KEY_MISMATCH,
// TLS_CERTIFICATE_EXPIRED.
absl::StatusOr<TlsMaterial> LoadTls(const TlsOptions& options);

// Whether a PEM file holds certificates that can all be read. FAILED_PRECONDITION, with the flag as
// the field: TLS_FILE_UNREADABLE, TLS_FILE_INVALID.
absl::Status CheckCertificates(const std::string& path, std::string_view flag);

// The files of TlsOptions while the server runs: certificates are renewed under it. Thread-safe and
// quick.
class TlsFiles {
 public:
  // Errors of LoadTls().
  static absl::StatusOr<std::unique_ptr<TlsFiles>> Open(TlsOptions options);

  // What the files hold, if that is another thing than was taken before; the first time, what
  // Open() read. Looks once a second at most. Files that do not pass LoadTls(), as when one of two
  // has been replaced, change nothing; the log says so.
  std::optional<TlsMaterial> TakeRenewed();

  bool asks_clients() const { return !options_.client_ca.empty(); }

 private:
  using Stamps = std::array<FileStamp, 3>;

  explicit TlsFiles(TlsOptions options) : options_(std::move(options)) {}
  Stamps Look() const;

  const TlsOptions options_;
  std::mutex mutex_;
  Stamps seen_;
  std::optional<TlsMaterial> read_;  // not taken yet
  std::chrono::steady_clock::time_point looked_;
  std::string said_;  // why they cannot be read now, said once
};

// Whether HOST:PORT can be reached from this machine only: 127.x.y.z, ::1, localhost, or a
// Unix socket.
bool IsLoopback(std::string_view address);

// Whether a host, without a port, is this machine itself: 127.x.y.z, ::1 or localhost.
bool IsLoopbackHost(std::string_view host);

}  // namespace litags

#endif  // LITAGS_SERVER_AUTH_TLS_H_
