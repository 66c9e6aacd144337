#ifndef LITAGS_SERVER_STORE_DIGEST_H_
#define LITAGS_SERVER_STORE_DIGEST_H_

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

#include "absl/status/statusor.h"

namespace litags {

// SHA-256 of a stream of bytes.
class Sha256 {
 public:
  Sha256();
  Sha256(Sha256&&) noexcept;
  Sha256& operator=(Sha256&&) noexcept;
  ~Sha256();
  void Update(std::string_view bytes);
  // 64 lower-case hex digits. Call once.
  std::string HexDigest();

  static std::string Hex(std::string_view bytes);  // of one piece

 private:
  struct Context;
  std::unique_ptr<Context> context_;
};

// Bytes as lower-case hex digits.
std::string ToHex(std::string_view bytes);

struct FileDigest {
  std::string sha256;  // 64 hex digits
  int64_t bytes = 0;
};
// Reads the whole file. Errors of FileError().
absl::StatusOr<FileDigest> DigestOfFile(const std::string& path);

// Whether it looks like a SHA-256 in hex, as blobs' names and the ends of their keys do.
bool IsDigest(std::string_view text);

// 2 n hex digits from the system's random source.
std::string RandomHex(int n);

}  // namespace litags

#endif  // LITAGS_SERVER_STORE_DIGEST_H_
