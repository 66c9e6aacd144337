// Inside this module: numbers of a TIFF block, which EXIF, TIFF and most cameras' RAW files are.
#ifndef LITAGS_ENGINE_IO_TIFF_READER_H_
#define LITAGS_ENGINE_IO_TIFF_READER_H_

#include <cstddef>
#include <cstdint>
#include <iterator>
#include <string_view>

#include "engine/io/byte_reader.h"

namespace litags {

// Reads in the block's byte order. Position 0, where no number lies, is "nowhere".
class TiffReader {
 public:
  static constexpr uint16_t kText = 2, kShort = 3, kLong = 4, kRational = 5, kDirectory = 13;

  explicit TiffReader(std::string_view tiff) : tiff_(tiff), little_(tiff.starts_with("II")) {}

  size_t FirstDirectory() const {
    const bool is_tiff = (little_ || tiff_.starts_with("MM")) && Get<uint16_t>(2) == 42;
    return is_tiff ? Get<uint32_t>(4) : 0;
  }

  // 0 beyond the end.
  template <typename T>
  T Get(size_t position) const {
    T value = 0;
    if (position == 0 || position > tiff_.size()) return value;
    ByteReader reader(tiff_.substr(position));
    little_ ? reader.Read(&value) : reader.ReadBig(&value);
    return value;
  }

  // Position of a tag's entry, of any type and count.
  size_t FindEntry(size_t directory, uint16_t tag) const {
    constexpr size_t kSize = 12;
    if (directory == 0) return 0;
    const size_t first = directory + 2, end = first + kSize * Get<uint16_t>(directory);
    for (size_t entry = first; entry < end && entry + kSize <= tiff_.size(); entry += kSize) {
      if (Get<uint16_t>(entry) == tag) return entry;
    }
    return 0;
  }

  uint16_t TypeOf(size_t entry) const { return entry == 0 ? 0 : Get<uint16_t>(entry + 2); }
  uint32_t CountOf(size_t entry) const { return entry == 0 ? 0 : Get<uint32_t>(entry + 4); }

  // Whether a directory and the values of its entries lie within the block.
  bool IsWhole(size_t directory) const {
    constexpr size_t kSize = 12;
    constexpr uint8_t kBytes[] = {0, 1, 1, 2, 4, 8, 1, 1, 2, 4, 8, 4, 8, 4};  // by type
    if (directory == 0 || directory + 2 > tiff_.size()) return false;
    const size_t first = directory + 2, end = first + kSize * Get<uint16_t>(directory);
    if (end > tiff_.size()) return false;
    for (size_t entry = first; entry < end; entry += kSize) {
      const uint16_t type = TypeOf(entry);
      const uint64_t size =
          uint64_t{CountOf(entry)} * (type < std::size(kBytes) ? kBytes[type] : 0);
      if (size > 4 && Get<uint32_t>(entry + 8) + size > tiff_.size()) return false;
    }
    return true;
  }

  // Position of the single value of a tag, or of where that is written.
  size_t Find(size_t directory, uint16_t tag, uint16_t type) const {
    const size_t entry = FindEntry(directory, tag);
    return TypeOf(entry) == type && CountOf(entry) == 1 ? entry + 8 : 0;
  }

  // Position of a directory that a tag points to.
  size_t FindDirectory(size_t directory, uint16_t tag) const {
    const size_t usual = Find(directory, tag, kLong);
    return Get<uint32_t>(usual != 0 ? usual : Find(directory, tag, kDirectory));
  }

  // 0 if there is none, or its lower part is 0.
  double GetRatio(size_t directory, uint16_t tag) const {
    const size_t at = Get<uint32_t>(Find(directory, tag, kRational));
    const uint32_t above = Get<uint32_t>(at), below = Get<uint32_t>(at + 4);
    return at == 0 || below == 0 ? 0 : double(above) / below;
  }

  // Without what follows its first NUL; empty if there is none, or one of impossible size.
  std::string_view GetText(size_t directory, uint16_t tag) const {
    constexpr uint32_t kMostBytes = 256;
    const size_t entry = FindEntry(directory, tag);
    const uint32_t count = CountOf(entry);
    if (TypeOf(entry) != kText || count > kMostBytes) return "";
    const size_t at = count <= 4 ? entry + 8 : Get<uint32_t>(entry + 8);
    if (at > tiff_.size() || tiff_.size() - at < count) return "";
    const std::string_view text = tiff_.substr(at, count);
    return text.substr(0, text.find('\0'));
  }

 private:
  const std::string_view tiff_;
  const bool little_;
};

}  // namespace litags

#endif  // LITAGS_ENGINE_IO_TIFF_READER_H_
