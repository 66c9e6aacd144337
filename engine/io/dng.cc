#include "engine/io/dng.h"

#include <cmath>
#include <iterator>
#include <map>
#include <string_view>

#include "engine/io/byte_reader.h"

namespace litags {
namespace {

enum Type : uint16_t { kByte = 1, kAscii = 2, kShort = 3, kLong = 4, kRational = 5, kSigned = 10 };

// A directory of a little-endian TIFF.
class Directory {
 public:
  void Shorts(uint16_t tag, std::initializer_list<int> values) {
    Entry& entry = Add(tag, kShort, values.size());
    for (const int value : values) AppendNumber(&entry.data, static_cast<uint16_t>(value));
  }
  void Long(uint16_t tag, uint32_t value) { AppendNumber(&Add(tag, kLong, 1).data, value); }
  void Text(uint16_t tag, std::string_view text) {
    Add(tag, kAscii, text.size() + 1).data = std::string(text) + '\0';
  }
  void Bytes(uint16_t tag, const std::string& bytes) { Add(tag, kByte, bytes.size()).data = bytes; }
  template <class Values>
  void Ratios(uint16_t tag, Type type, const Values& values) {
    constexpr int kBelow = 1000000;
    Entry& entry = Add(tag, type, std::size(values));
    for (const double value : values) {
      AppendNumber(&entry.data, static_cast<int32_t>(std::lround(value * kBelow)));
      AppendNumber(&entry.data, int32_t{kBelow});
    }
  }

  // With the values behind it; `start` is its own position.
  std::string Write(uint32_t start) const {
    std::string table, values;
    AppendNumber(&table, static_cast<uint16_t>(entries_.size()));
    const size_t end = start + 2 + 12 * entries_.size() + 4;
    for (const auto& [tag, entry] : entries_) {
      AppendNumber(&table, tag);
      AppendNumber(&table, static_cast<uint16_t>(entry.type));
      AppendNumber(&table, entry.count);
      if (entry.data.size() <= 4) {
        table += entry.data + std::string(4 - entry.data.size(), '\0');
        continue;
      }
      AppendNumber(&table, static_cast<uint32_t>(end + values.size()));
      values += entry.data;
      if (values.size() % 2 == 1) values += '\0';
    }
    AppendNumber(&table, uint32_t{0});  // no directory follows
    return table + values;
  }

 private:
  struct Entry {
    Type type;
    uint32_t count;
    std::string data;
  };
  Entry& Add(uint16_t tag, Type type, size_t count) {
    return entries_[tag] = {type, static_cast<uint32_t>(count), ""};
  }
  std::map<uint16_t, Entry> entries_;  // in order of their tags, as TIFF wants them
};

// A list of opcodes with a GainMap of one point, which is 1. Big-endian.
std::string GainMapOf(const SensorFrame& frame) {
  std::string list;
  const auto add = [&](uint32_t number) {
    for (int shift = 24; shift >= 0; shift -= 8) list += static_cast<char>(number >> shift);
  };
  constexpr uint32_t kGainMap = 9, kVersion = 0x01030000, kBytes = 80, kOne = 0x3F800000;
  for (const uint32_t number : {1u, kGainMap, kVersion, 0u, kBytes}) add(number);
  // The area, its first plane and planes, rows and columns between its pixels, points.
  const auto height = static_cast<uint32_t>(frame.height),
             width = static_cast<uint32_t>(frame.width);
  for (const uint32_t number : {0u, 0u, height, width, 0u, 1u, 1u, 1u, 1u, 1u}) add(number);
  for (int i = 0; i < 8; ++i) add(0);                    // doubles: between points, and the first
  for (const uint32_t number : {1u, kOne}) add(number);  // planes of the map, its point
  return list;
}

Directory ExposureOf(const SensorFrame& frame) {
  Directory exif;
  if (frame.exposure_time > 0) exif.Ratios(33434, kRational, std::array{frame.exposure_time});
  if (frame.f_number > 0) exif.Ratios(33437, kRational, std::array{frame.f_number});
  if (frame.iso > 0) exif.Shorts(34855, {frame.iso});
  if (frame.focal_length_35mm > 0) exif.Shorts(41989, {frame.focal_length_35mm});
  return exif;
}

}  // namespace

std::string EncodeDng(const SensorFrame& frame) {
  // XYZ to sRGB's light under D65 (IEC 61966-2-1).
  constexpr std::array<double, 9> kColorMatrix = {3.2406, -1.5372, -0.4986, -0.9689, 1.8758,
                                                  0.0415, 0.0557,  -0.2040, 1.0570};
  constexpr int kSensorData = 32803, kD65 = 21;
  constexpr uint32_t kHeader = 8;
  const uint32_t bytes = static_cast<uint32_t>(2 * frame.numbers.size());
  Directory main;
  main.Long(254, 0);  // the full picture
  main.Long(256, frame.width);
  main.Long(257, frame.height);
  main.Shorts(258, {16});
  main.Shorts(259, {1});  // not compressed
  main.Shorts(262, {kSensorData});
  main.Text(271, "litags");
  main.Text(272, "sample");
  main.Long(273, kHeader);  // the numbers come first
  main.Shorts(274, {frame.orientation});
  main.Shorts(277, {1});
  main.Long(278, frame.height);
  main.Long(279, bytes);
  main.Shorts(284, {1});
  main.Shorts(33421, {2, 2});
  main.Bytes(33422, std::string("\0\1\1\2", 4));
  main.Bytes(50706, std::string("\1\4\0\0", 4));
  main.Text(50708, "litags sample");
  main.Long(50714, frame.black);
  main.Long(50717, frame.white);
  main.Ratios(50721, kSigned, kColorMatrix);
  main.Ratios(50728, kRational, frame.neutral);
  main.Shorts(50778, {kD65});
  if (frame.has_gain_map) main.Bytes(51009, GainMapOf(frame));

  const uint32_t exif_start = kHeader + bytes;
  const std::string exif = ExposureOf(frame).Write(exif_start);
  const uint32_t main_start = exif_start + static_cast<uint32_t>(exif.size());
  main.Long(34665, exif_start);
  std::string dng("II*\0", 4);
  AppendNumber(&dng, main_start);
  dng.append(reinterpret_cast<const char*>(frame.numbers.data()), bytes);
  return dng + exif + main.Write(main_start);
}

}  // namespace litags
