#ifndef LITAGS_ENGINE_PIPELINE_FINGERPRINT_H_
#define LITAGS_ENGINE_PIPELINE_FINGERPRINT_H_

#include <cstddef>
#include <cstdint>
#include <string>
#include <string_view>
#include <type_traits>

#include "absl/status/status.h"
#include "absl/strings/str_format.h"

namespace litags {

// FNV-1a, 64 bits: tells inputs apart, not a defence.
class Fingerprint {
 public:
  void Add(const void* data, size_t size) {
    const auto* p = static_cast<const unsigned char*>(data);
    for (size_t i = 0; i < size; ++i) hash_ = (hash_ ^ p[i]) * 0x100000001B3ull;
  }
  // Not for types with padding: its bytes may be anything.
  template <class T>
  void Add(const T& value) {
    static_assert(std::is_trivially_copyable_v<T>);
    Add(&value, sizeof(value));
  }
  // The bytes of a file. Errors of ReadFile.
  absl::Status AddFile(const std::string& path, std::string_view field, int64_t max_bytes);
  // Nothing of a file that cannot be read: who needs it says why.
  void AddFileIfReadable(const std::string& path, int64_t max_bytes) {
    AddFile(path, "", max_bytes).IgnoreError();
  }
  uint64_t hash() const { return hash_; }
  std::string Text() const { return absl::StrFormat("%016x", hash_); }

 private:
  uint64_t hash_ = 0xCBF29CE484222325ull;
};

}  // namespace litags

#endif  // LITAGS_ENGINE_PIPELINE_FINGERPRINT_H_
