// For tests: photos with EXIF.
#ifndef LITAGS_ENGINE_IO_EXIF_TEST_UTIL_H_
#define LITAGS_ENGINE_IO_EXIF_TEST_UTIL_H_

#include <cstdint>
#include <string>

namespace litags {

inline std::string Big32(uint32_t v) {
  return {static_cast<char>(v >> 24), static_cast<char>(v >> 16), static_cast<char>(v >> 8),
          static_cast<char>(v)};
}

// A TIFF block with a camera directory: FocalLengthIn35mmFilm (0: without) and FocalLength.
inline std::string FocalBlock(int in_35mm, uint32_t above, uint32_t below) {
  const auto entry = [](int tag, int type, const std::string& value) {
    return Big32(uint32_t(tag) << 16 | type) + Big32(1) + value;
  };
  const std::string head("MM\0\x2A\0\0\0\x08", 8), one("\0\1", 2), two("\0\2", 2);
  const uint32_t camera = 26, ratio = 26 + 2 + 2 * 12 + 4;
  return head + one + entry(0x8769, 4, Big32(camera)) + Big32(0) + two +
         entry(0x920A, 5, Big32(ratio)) +
         entry(in_35mm > 0 ? 0xA405 : 0xA406, 3, Big32(uint32_t(in_35mm) << 16)) + Big32(0) +
         Big32(above) + Big32(below);
}

// The same with what the sensor's px are, per inch, the size that the camera wrote, and its digital
// zoom in tenths (0: not used).
inline std::string LensBlock(int in_35mm, int mm, int pixels_per_inch, int width, int height,
                             int zoom = 0) {
  const auto entry = [](int tag, int type, const std::string& value) {
    return Big32(uint32_t(tag) << 16 | type) + Big32(1) + value;
  };
  const auto number = [&](int tag, int value) {
    return entry(tag, 3, Big32(uint32_t(value) << 16));
  };
  const uint32_t camera = 26, ratios = camera + 2 + 6 * 12 + 4;
  return std::string("MM\0\x2A\0\0\0\x08\0\1", 10) + entry(0x8769, 4, Big32(camera)) + Big32(0) +
         std::string("\0\6", 2) + entry(0x920A, 5, Big32(ratios)) + number(0xA002, width) +
         number(0xA003, height) + entry(0xA20E, 5, Big32(ratios + 8)) +
         entry(0xA404, 5, Big32(ratios + 16)) + number(0xA405, in_35mm) + Big32(0) +
         Big32(static_cast<uint32_t>(mm)) + Big32(1) +
         Big32(static_cast<uint32_t>(pixels_per_inch)) + Big32(1) +
         Big32(static_cast<uint32_t>(zoom)) + Big32(10);
}

// A TIFF block with a camera's make and model, of four letters or more each, and its focal length
// as FocalBlock has it.
inline std::string CameraBlock(const std::string& make, const std::string& model, int in_35mm) {
  const auto entry = [](int tag, int type, size_t count, size_t value) {
    return Big32(uint32_t(tag) << 16 | type) + Big32(uint32_t(count)) + Big32(uint32_t(value));
  };
  const size_t camera = 10 + 3 * 12 + 4, texts = camera + 2 + 12 + 4;
  return std::string("MM\0\x2A\0\0\0\x08\0\3", 10) + entry(0x010F, 2, make.size() + 1, texts) +
         entry(0x0110, 2, model.size() + 1, texts + make.size() + 1) + entry(0x8769, 4, 1, camera) +
         Big32(0) + std::string("\0\1", 2) + entry(0xA405, 3, 1, size_t(in_35mm) << 16) + Big32(0) +
         make + '\0' + model + '\0';
}

// A TIFF block with a camera directory: its ISO, and a larger one in another tag.
inline std::string IsoBlock(int iso, int tag, uint32_t larger) {
  const auto entry = [](int tag, int type, uint32_t value) {
    return Big32(uint32_t(tag) << 16 | type) + Big32(1) + Big32(value);
  };
  const uint32_t camera = 26;
  return std::string("MM\0\x2A\0\0\0\x08\0\1", 10) + entry(0x8769, 4, camera) + Big32(0) +
         std::string("\0\2", 2) + entry(0x8827, 3, uint32_t(iso) << 16) + entry(tag, 4, larger) +
         Big32(0);
}

// A TIFF block with a camera directory: colours that it does not name, and an index of
// interoperability of three letters.
inline std::string InteroperabilityBlock(const std::string& index) {
  const auto entry = [](int tag, int type, uint32_t count, uint32_t value) {
    return Big32(uint32_t(tag) << 16 | type) + Big32(count) + Big32(value);
  };
  const uint32_t camera = 26, interoperability = camera + 2 + 2 * 12 + 4;
  return std::string("MM\0\x2A\0\0\0\x08\0\1", 10) + entry(0x8769, 4, 1, camera) + Big32(0) +
         std::string("\0\2", 2) + entry(0xA001, 3, 1, 0xFFFF0000) +
         entry(0xA005, 4, 1, interoperability) + Big32(0) + std::string("\0\1", 2) +
         Big32(1 << 16 | 2) + Big32(4) + index + '\0' + Big32(0);
}

// A TIFF block that holds an orientation and nothing else.
inline std::string ExifBlock(int orientation, bool little) {
  const auto n = [&](int value, int size) {
    std::string s;
    for (int i = 0; i < size; ++i) s += static_cast<char>(value >> 8 * (little ? i : size - 1 - i));
    return s;
  };
  return std::string(little ? "II" : "MM") + n(42, 2) + n(8, 4) + n(1, 2) + n(0x0112, 2) + n(3, 2) +
         n(1, 4) + n(orientation, 2) + n(0, 2) + n(0, 4);
}

inline std::string WithJpegApp1(const std::string& jpeg, const std::string& payload) {
  const size_t length = payload.size() + 2;
  return jpeg.substr(0, 2) + "\xFF\xE1" + static_cast<char>(length >> 8) +
         static_cast<char>(length & 0xFF) + payload + jpeg.substr(2);
}

inline std::string WithJpegExif(const std::string& jpeg, const std::string& tiff) {
  return WithJpegApp1(jpeg, std::string("Exif\0\0", 6) + tiff);
}

// XMP, of which only `text` is there.
inline std::string WithJpegXmp(const std::string& jpeg, const std::string& text) {
  return WithJpegApp1(jpeg, std::string("http://ns.adobe.com/xap/1.0/\0", 29) + text);
}

}  // namespace litags

#endif  // LITAGS_ENGINE_IO_EXIF_TEST_UTIL_H_
