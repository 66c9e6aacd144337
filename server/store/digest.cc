#include "server/store/digest.h"

#include <openssl/evp.h>
#include <openssl/rand.h>

#include <fstream>

#include "absl/strings/escaping.h"
#include "engine/core/check.h"
#include "server/store/file_error.h"

namespace litags {

struct Sha256::Context {
  EVP_MD_CTX* evp = EVP_MD_CTX_new();
  ~Context() { EVP_MD_CTX_free(evp); }
};

Sha256::Sha256() : context_(std::make_unique<Context>()) {
  LITAGS_CHECK(EVP_DigestInit_ex(context_->evp, EVP_sha256(), nullptr) == 1);
}

Sha256::Sha256(Sha256&&) noexcept = default;
Sha256& Sha256::operator=(Sha256&&) noexcept = default;
Sha256::~Sha256() = default;

void Sha256::Update(std::string_view bytes) {
  LITAGS_CHECK(EVP_DigestUpdate(context_->evp, bytes.data(), bytes.size()) == 1);
}

absl::StatusOr<FileDigest> DigestOfFile(const std::string& path) {
  FileDigest file;
  Sha256 sha;
  std::string chunk(size_t{1} << 20, '\0');
  std::ifstream in(path, std::ios::binary);
  while (in) {
    in.read(chunk.data(), static_cast<std::streamsize>(chunk.size()));
    sha.Update({chunk.data(), static_cast<size_t>(in.gcount())});
    file.bytes += in.gcount();
  }
  if (!in.eof()) return FileError("read", path, EIO);
  file.sha256 = sha.HexDigest();
  return file;
}

bool IsDigest(std::string_view text) {
  return text.size() == 64 && text.find_first_not_of("0123456789abcdef") == std::string_view::npos;
}

std::string Sha256::HexDigest() {
  std::string digest(32, '\0');
  LITAGS_CHECK(EVP_DigestFinal_ex(context_->evp, reinterpret_cast<unsigned char*>(digest.data()),
                                  nullptr) == 1);
  return ToHex(digest);
}

std::string Sha256::Hex(std::string_view bytes) {
  Sha256 sha;
  sha.Update(bytes);
  return sha.HexDigest();
}

std::string ToHex(std::string_view bytes) {
  return absl::BytesToHexString(absl::string_view(bytes.data(), bytes.size()));
}

std::string RandomHex(int n) {
  std::string bytes(n, '\0');
  LITAGS_CHECK(RAND_bytes(reinterpret_cast<unsigned char*>(bytes.data()), n) == 1);
  return ToHex(bytes);
}

}  // namespace litags
