// Inside this module: a cursor over untrusted bytes that never reads past their end, and its
// counterpart for writing.
#ifndef LITAGS_ENGINE_IO_BYTE_READER_H_
#define LITAGS_ENGINE_IO_BYTE_READER_H_

#include <bit>
#include <cstdint>
#include <cstring>
#include <string>
#include <string_view>
#include <type_traits>

namespace litags {

static_assert(std::endian::native == std::endian::little,
              "files are little-endian and read by memcpy");

// Every read returns false, and moves nothing, if too few bytes are left.
class ByteReader {
 public:
  explicit ByteReader(std::string_view bytes) : bytes_(bytes) {}

  size_t position() const { return position_; }
  size_t remaining() const { return bytes_.size() - position_; }

  // Little-endian number.
  template <typename T>
  bool Read(T* value) {
    static_assert(std::is_arithmetic_v<T>);
    if (remaining() < sizeof(T)) return false;
    std::memcpy(value, bytes_.data() + position_, sizeof(T));
    position_ += sizeof(T);
    return true;
  }

  // Big-endian unsigned number.
  template <typename T>
  bool ReadBig(T* value) {
    static_assert(std::is_unsigned_v<T>);
    if (remaining() < sizeof(T)) return false;
    T result = 0;
    for (size_t i = 0; i < sizeof(T); ++i) {
      result = static_cast<T>((uint64_t{result} << 8) | uint8_t(bytes_[position_ + i]));
    }
    position_ += sizeof(T);
    *value = result;
    return true;
  }

  bool ReadBytes(size_t n, std::string_view* out) {
    if (remaining() < n) return false;
    *out = bytes_.substr(position_, n);
    position_ += n;
    return true;
  }

  // Bytes up to a zero byte, which is consumed and left out.
  bool ReadCString(std::string_view* out) {
    const size_t end = bytes_.find('\0', position_);
    if (end == std::string_view::npos) return false;
    *out = bytes_.substr(position_, end - position_);
    position_ = end + 1;
    return true;
  }

  bool Skip(size_t n) {
    if (remaining() < n) return false;
    position_ += n;
    return true;
  }

  // Whether `count` records of at least `record_size` bytes can follow: checked before a count
  // from a file is used for an allocation.
  bool CanHold(uint64_t count, size_t record_size) const {
    return count <= remaining() / record_size;
  }

 private:
  std::string_view bytes_;
  size_t position_ = 0;
};

// Appends a little-endian number.
template <typename T>
void AppendNumber(std::string* out, T value) {
  static_assert(std::is_arithmetic_v<T>);
  char raw[sizeof(T)];
  std::memcpy(raw, &value, sizeof(T));
  out->append(raw, sizeof(T));
}

}  // namespace litags

#endif  // LITAGS_ENGINE_IO_BYTE_READER_H_
