#ifndef LITAGS_SERVER_STORE_DIGEST_H_
#define LITAGS_SERVER_STORE_DIGEST_H_

#include <memory>
#include <string>
#include <string_view>

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

// 2 n hex digits from the system's random source.
std::string RandomHex(int n);

}  // namespace litags

#endif  // LITAGS_SERVER_STORE_DIGEST_H_
