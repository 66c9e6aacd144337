#include "server/testing/certificates.h"

#include <openssl/evp.h>
#include <openssl/pem.h>
#include <openssl/rsa.h>
#include <openssl/x509v3.h>

#include <cstdio>
#include <fstream>
#include <iterator>

#include "engine/core/check.h"

namespace litags {
namespace {

struct Pair {
  EVP_PKEY* key;
  X509* certificate = X509_new();
  // Elliptic curves take microseconds, unlike RSA.
  explicit Pair(bool weak = false) : key(weak ? EVP_RSA_gen(512) : EVP_EC_gen("P-256")) {}
  ~Pair() {
    EVP_PKEY_free(key);
    X509_free(certificate);
  }
};

void Extend(X509* certificate, int id, const char* value) {
  X509_EXTENSION* extension = X509V3_EXT_conf_nid(nullptr, nullptr, id, value);
  LITAGS_CHECK(extension != nullptr);
  X509_add_ext(certificate, extension, -1);
  X509_EXTENSION_free(extension);
}

void Fill(Pair& pair, const std::string& name, long serial, long seconds) {
  X509_set_version(pair.certificate, X509_VERSION_3);
  ASN1_INTEGER_set(X509_get_serialNumber(pair.certificate), serial);
  X509_gmtime_adj(X509_getm_notBefore(pair.certificate), -86400);
  X509_gmtime_adj(X509_getm_notAfter(pair.certificate), seconds);
  X509_set_pubkey(pair.certificate, pair.key);
  X509_NAME_add_entry_by_txt(X509_get_subject_name(pair.certificate), "CN", MBSTRING_ASC,
                             reinterpret_cast<const unsigned char*>(name.c_str()), -1, -1, 0);
}

template <typename Write>
void WriteTo(const std::string& path, Write write) {
  std::FILE* file = std::fopen(path.c_str(), "w");
  LITAGS_CHECK(file != nullptr);
  LITAGS_CHECK(write(file) == 1);
  std::fclose(file);
}

}  // namespace

struct TestAuthority::Keys {
  Pair ca;
  long next_serial = 2;
};

TestAuthority::TestAuthority(std::string folder)
    : folder_(std::move(folder)), keys_(std::make_unique<Keys>()) {
  Pair& ca = keys_->ca;
  Fill(ca, "test authority", 1, 86400);
  X509_set_issuer_name(ca.certificate, X509_get_subject_name(ca.certificate));
  Extend(ca.certificate, NID_basic_constraints, "critical,CA:TRUE");
  X509_sign(ca.certificate, ca.key, EVP_sha256());
  WriteTo(Path("ca.crt"), [&](std::FILE* file) { return PEM_write_X509(file, ca.certificate); });
}

TestAuthority::~TestAuthority() = default;

void TestAuthority::Issue(const std::string& name, long seconds) { Write(name, seconds, false); }

void TestAuthority::IssueWeak(const std::string& name) { Write(name, 3600, true); }

void TestAuthority::Write(const std::string& name, long seconds, bool weak) {
  Pair pair(weak);
  Fill(pair, name, keys_->next_serial++, seconds);
  X509_set_issuer_name(pair.certificate, X509_get_subject_name(keys_->ca.certificate));
  Extend(pair.certificate, NID_subject_alt_name, "IP:127.0.0.1,DNS:localhost");
  X509_sign(pair.certificate, keys_->ca.key, EVP_sha256());
  WriteTo(Path(name + ".crt"),
          [&](std::FILE* file) { return PEM_write_X509(file, pair.certificate); });
  WriteTo(Path(name + ".key"), [&](std::FILE* file) {
    return PEM_write_PrivateKey(file, pair.key, nullptr, nullptr, 0, nullptr, nullptr);
  });
}

std::string TestAuthority::Read(const std::string& file) const {
  std::ifstream stream(Path(file));
  return {std::istreambuf_iterator<char>(stream), {}};
}

}  // namespace litags
