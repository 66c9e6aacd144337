#include "server/auth/tls.h"

#include <openssl/bio.h>
#include <openssl/err.h>
#include <openssl/pem.h>
#include <openssl/ssl.h>
#include <openssl/x509.h>
#include <spdlog/spdlog.h>

#include <cerrno>
#include <cstring>
#include <fstream>
#include <memory>
#include <vector>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "server/net/address.h"
#include "server/store/file_error.h"

namespace litags {
namespace {

constexpr size_t kMaxPemBytes = 4 << 20;

template <auto Free>
struct Freer {
  template <typename T>
  void operator()(T* object) const {
    Free(object);
  }
};
using Bio = std::unique_ptr<BIO, Freer<BIO_free>>;
using Certificate = std::unique_ptr<X509, Freer<X509_free>>;
using Key = std::unique_ptr<EVP_PKEY, Freer<EVP_PKEY_free>>;
using Context = std::unique_ptr<SSL_CTX, Freer<SSL_CTX_free>>;

absl::Status TlsError(std::string_view reason, std::string_view flag, std::string_view message) {
  return MakeError(absl::StatusCode::kFailedPrecondition, reason, flag, message);
}

absl::StatusOr<std::string> ReadPem(const std::string& path, std::string_view flag) {
  errno = 0;
  std::ifstream file(path, std::ios::binary);
  std::string text(kMaxPemBytes + 1, '\0');
  file.read(text.data(), static_cast<std::streamsize>(text.size()));
  text.resize(static_cast<size_t>(file.gcount()));
  if (text.empty() || text.size() > kMaxPemBytes) {
    const char* why = errno          ? std::strerror(errno)
                      : text.empty() ? "it is empty or no file"
                                     : "it is too long for a PEM file";
    return TlsError("TLS_FILE_UNREADABLE", flag,
                    absl::StrCat("cannot read ", path, ": ", why,
                                 "; give a PEM file that the server's user may read"));
  }
  return text;
}

Bio OpenText(const std::string& text) {
  return Bio(BIO_new_mem_buf(text.data(), static_cast<int>(text.size())));
}

// A key that asks for a passphrase is refused instead of asking the terminal.
int NoPassphrase(char*, int, int, void*) { return -1; }

// Why OpenSSL's last call failed: "bad base64 decode".
std::string TakeReason() {
  const char* reason = ERR_reason_error_string(ERR_peek_last_error());
  ERR_clear_error();
  return reason ? reason : "no reason given";
}

// All certificates of the file: one that is damaged counts even if it is not the first.
absl::StatusOr<std::vector<Certificate>> ParseCertificates(const std::string& text,
                                                           const std::string& path,
                                                           std::string_view flag) {
  const Bio bio = OpenText(text);
  std::vector<Certificate> certificates;
  while (true) {
    Certificate next(PEM_read_bio_X509(bio.get(), nullptr, NoPassphrase, nullptr));
    if (!next) break;
    certificates.push_back(std::move(next));
  }
  const bool at_end = ERR_GET_REASON(ERR_peek_last_error()) == PEM_R_NO_START_LINE;
  const std::string reason = TakeReason();
  if (certificates.empty()) {
    return TlsError("TLS_FILE_INVALID", flag,
                    absl::StrCat(path, " holds no PEM certificate (\"-----BEGIN CERTIFICATE\")"));
  }
  if (!at_end) {
    return TlsError("TLS_FILE_INVALID", flag,
                    absl::StrCat("certificate ", certificates.size() + 1, " of ", path,
                                 " is damaged (", reason, "); write the whole file again"));
  }
  return certificates;
}

std::string TimeText(const ASN1_TIME* time) {
  const Bio text(BIO_new(BIO_s_mem()));
  ASN1_TIME_print(text.get(), time);
  char* data = nullptr;
  const long size = BIO_get_mem_data(text.get(), &data);
  return std::string(data, static_cast<size_t>(size));
}

absl::StatusOr<Key> ParseKey(const std::string& text, const std::string& path) {
  Key key(PEM_read_bio_PrivateKey(OpenText(text).get(), nullptr, NoPassphrase, nullptr));
  ERR_clear_error();
  if (!key) {
    return TlsError("TLS_FILE_INVALID", "--tls-key",
                    absl::StrCat(path,
                                 " holds no private key in PEM form without a "
                                 "passphrase (\"-----BEGIN PRIVATE KEY\")"));
  }
  return key;
}

absl::Status CheckPair(const std::vector<Certificate>& chain, EVP_PKEY* key,
                       const TlsOptions& options) {
  const bool match = X509_check_private_key(chain.front().get(), key) == 1;
  ERR_clear_error();
  if (!match) {
    return TlsError("TLS_KEY_MISMATCH", "--tls-key",
                    absl::StrCat(options.key, " is not the key of the certificate in ",
                                 options.cert, "; give the two files that were made together"));
  }
  // OpenSSL refuses what is below its security level: short keys, old digests.
  const Context context(SSL_CTX_new(TLS_server_method()));
  bool usable = context && SSL_CTX_use_certificate(context.get(), chain.front().get()) == 1 &&
                SSL_CTX_use_PrivateKey(context.get(), key) == 1;
  for (size_t i = 1; usable && i < chain.size(); ++i) {
    usable = SSL_CTX_add1_chain_cert(context.get(), chain[i].get()) == 1;
  }
  const std::string reason = TakeReason();
  if (usable) return absl::OkStatus();
  return TlsError("TLS_FILE_INVALID", "--tls-cert",
                  absl::StrCat("OpenSSL does not serve the certificates in ", options.cert, " (",
                               reason, "); make them with a longer key or a newer digest"));
}

}  // namespace

absl::Status CheckCertificates(const std::string& path, std::string_view flag) {
  LITAGS_ASSIGN_OR_RETURN(const std::string text, ReadPem(path, flag));
  return ParseCertificates(text, path, flag).status();
}

absl::StatusOr<TlsMaterial> LoadTls(const TlsOptions& options) {
  if (options.cert.empty() || options.key.empty()) {
    return TlsError("TLS_INCOMPLETE", options.cert.empty() ? "--tls-cert" : "--tls-key",
                    "TLS needs both --tls-cert and --tls-key; give the one that is missing");
  }
  TlsMaterial material;
  LITAGS_ASSIGN_OR_RETURN(material.cert, ReadPem(options.cert, "--tls-cert"));
  LITAGS_ASSIGN_OR_RETURN(material.key, ReadPem(options.key, "--tls-key"));
  LITAGS_ASSIGN_OR_RETURN(const std::vector<Certificate> chain,
                          ParseCertificates(material.cert, options.cert, "--tls-cert"));
  LITAGS_ASSIGN_OR_RETURN(const Key key, ParseKey(material.key, options.key));
  LITAGS_RETURN_IF_ERROR(CheckPair(chain, key.get(), options));
  const ASN1_TIME* end = X509_get0_notAfter(chain.front().get());
  material.expires = TimeText(end);
  if (X509_cmp_current_time(end) < 0) {
    return TlsError("TLS_CERTIFICATE_EXPIRED", "--tls-cert",
                    absl::StrCat("the certificate in ", options.cert, " ended on ",
                                 material.expires, "; clients refuse it: renew it"));
  }
  if (!options.client_ca.empty()) {
    LITAGS_ASSIGN_OR_RETURN(material.client_ca, ReadPem(options.client_ca, "--tls-client-ca"));
    LITAGS_RETURN_IF_ERROR(
        ParseCertificates(material.client_ca, options.client_ca, "--tls-client-ca").status());
  }
  return material;
}

absl::StatusOr<std::unique_ptr<TlsFiles>> TlsFiles::Open(TlsOptions options) {
  std::unique_ptr<TlsFiles> files(new TlsFiles(std::move(options)));
  files->seen_ = files->Look();  // before reading: a change meanwhile is seen later
  files->looked_ = std::chrono::steady_clock::now();
  LITAGS_ASSIGN_OR_RETURN(files->read_, LoadTls(files->options_));
  spdlog::info("TLS with a certificate in force until {}", files->read_->expires);
  return files;
}

TlsFiles::Stamps TlsFiles::Look() const {
  return {FileStamp::Of(options_.cert), FileStamp::Of(options_.key),
          FileStamp::Of(options_.client_ca)};
}

std::optional<TlsMaterial> TlsFiles::TakeRenewed() {
  const std::lock_guard lock(mutex_);
  const auto now = std::chrono::steady_clock::now();
  if (now - looked_ >= kLookInterval) {
    looked_ = now;
    std::string said;
    if (const Stamps stamps = Look(); stamps != seen_) {
      auto renewed = LoadTls(options_);
      const bool is_read = !HasReason(renewed.status(), "TLS_FILE_UNREADABLE");
      if (is_read) seen_ = stamps;  // what could not be read is tried again
      if (renewed.ok()) {
        spdlog::info("TLS files were renewed: a certificate in force until {}", renewed->expires);
        read_ = *std::move(renewed);
      } else {
        said = std::string(renewed.status().message());
        if (is_read || said != said_) spdlog::error("TLS stays as it was: {}", said);
      }
    }
    said_ = said;
  }
  return std::exchange(read_, std::nullopt);
}

bool IsLoopback(std::string_view address) {
  return IsUnixSocket(address) || IsLoopbackHost(SplitHostPort(address).host);
}

bool IsLoopbackHost(std::string_view host) {
  return host == "localhost" || host == "[::1]" || host == "::1" ||
         (host.starts_with("127.") &&
          host.find_first_not_of("0123456789.") == std::string_view::npos);
}

}  // namespace litags
