#include "engine/io/image_header.h"

#include "engine/io/byte_reader.h"
#include "engine/io/io_error.h"

namespace litags {
namespace {

constexpr std::string_view kJpegMagic = "\xFF\xD8\xFF";
constexpr std::string_view kPngMagic = "\x89PNG\r\n\x1A\n";
constexpr std::string_view kExifPrefix("Exif\0\0", 6);

absl::Status Truncated(std::string_view field) {
  return InvalidField("IMAGE_TRUNCATED", field, "the file ends early; send the whole file again");
}

absl::Status Corrupt(std::string_view field, std::string_view what) {
  return InvalidField("IMAGE_CORRUPT", field, absl::StrCat(Absl(what), "; send the file again"));
}

// Start of frame: SOF0..SOF15 but for DHT (C4), JPG (C8) and DAC (CC), which share the range.
bool IsStartOfFrame(uint8_t marker) {
  return marker >= 0xC0 && marker <= 0xCF && marker != 0xC4 && marker != 0xC8 && marker != 0xCC;
}

// Markers without a length: TEM and RST0..RST7.
bool IsBareMarker(uint8_t marker) { return marker == 0x01 || (marker >= 0xD0 && marker <= 0xD7); }

// Next marker of a JPEG: FF, any number of fill bytes FF, then the code. What stands before it is
// skipped, as libjpeg does.
bool ReadMarker(ByteReader* reader, uint8_t* marker) {
  do {
    if (!reader->Read(marker)) return false;
  } while (*marker != 0xFF);
  do {
    if (!reader->Read(marker)) return false;
  } while (*marker == 0xFF);
  return true;
}

struct PngChunk {
  std::string_view type, data;
};

// One chunk with its CRC (which libpng checks when it decodes); false if it is not all there.
bool ReadChunk(ByteReader* reader, PngChunk* chunk) {
  uint32_t size = 0;
  return reader->ReadBig(&size) && reader->ReadBytes(4, &chunk->type) &&
         reader->ReadBytes(size, &chunk->data) && reader->Skip(4);
}

}  // namespace

std::optional<ImageFormat> SniffImageFormat(std::string_view bytes) {
  if (bytes.starts_with(kJpegMagic)) return ImageFormat::kJpeg;
  if (bytes.starts_with(kPngMagic)) return ImageFormat::kPng;
  return std::nullopt;
}

int ParseExifOrientation(std::string_view tiff) {
  constexpr uint16_t kOrientationTag = 0x0112, kShort = 3;
  const bool little = tiff.starts_with("II");
  if (!little && !tiff.starts_with("MM")) return 1;
  ByteReader reader(tiff);
  const auto u16 = [&](uint16_t* v) { return little ? reader.Read(v) : reader.ReadBig(v); };
  const auto u32 = [&](uint32_t* v) { return little ? reader.Read(v) : reader.ReadBig(v); };

  uint16_t order = 0, magic = 0, entries = 0;
  uint32_t directory = 0;
  if (!u16(&order) || !u16(&magic) || magic != 42 || !u32(&directory)) return 1;
  if (directory < reader.position() || !reader.Skip(directory - reader.position())) return 1;
  if (!u16(&entries)) return 1;
  for (uint16_t i = 0; i < entries; ++i) {
    uint16_t tag = 0, type = 0, value = 0, unused = 0;
    uint32_t count = 0;
    if (!u16(&tag) || !u16(&type) || !u32(&count) || !u16(&value) || !u16(&unused)) return 1;
    if (tag == kOrientationTag && type == kShort && count == 1) {
      return value >= 1 && value <= 8 ? value : 1;
    }
  }
  return 1;
}

absl::StatusOr<ImageInfo> ParseJpegHeader(std::string_view bytes, std::string_view field) {
  constexpr uint8_t kEndOfImage = 0xD9, kStartOfScan = 0xDA, kApp1 = 0xE1;
  ImageInfo info;
  info.format = ImageFormat::kJpeg;
  ByteReader reader(bytes);
  reader.Skip(2);  // SOI
  while (true) {
    uint8_t marker = 0;
    if (!ReadMarker(&reader, &marker)) return Truncated(field);
    if (IsBareMarker(marker)) continue;
    if (marker == kEndOfImage) return Corrupt(field, "the JPEG ends without a picture");
    uint16_t length = 0;
    std::string_view segment;
    if (!reader.ReadBig(&length)) return Truncated(field);
    if (length < 2) return Corrupt(field, "a JPEG segment has an impossible length");
    if (!reader.ReadBytes(length - 2u, &segment)) return Truncated(field);
    if (marker == kApp1 && segment.starts_with(kExifPrefix) && info.orientation == 1) {
      info.orientation = ParseExifOrientation(segment.substr(kExifPrefix.size()));
    }
    if (IsStartOfFrame(marker)) {
      ByteReader frame(segment);
      uint8_t depth = 0;
      uint16_t height = 0, width = 0;
      if (!frame.Read(&depth) || !frame.ReadBig(&height) || !frame.ReadBig(&width)) {
        return Corrupt(field, "the JPEG frame header is too short");
      }
      info.bit_depth = depth;
      info.width = width;
      info.height = height;
    }
    if (marker == kStartOfScan) break;
  }
  if (info.width == 0 || info.height == 0) return Corrupt(field, "the JPEG states no picture size");
  return info;
}

absl::StatusOr<ImageInfo> ParsePngHeader(std::string_view bytes, std::string_view field) {
  constexpr uint32_t kMaxSide = 0x7FFFFFFF;  // PNG specification
  ImageInfo info;
  info.format = ImageFormat::kPng;
  ByteReader reader(bytes);
  reader.Skip(kPngMagic.size());
  PngChunk chunk;
  if (!ReadChunk(&reader, &chunk)) return Truncated(field);
  ByteReader header(chunk.data);
  uint32_t width = 0, height = 0;
  uint8_t depth = 0;
  if (chunk.type != "IHDR" || !header.ReadBig(&width) || !header.ReadBig(&height) ||
      !header.Read(&depth)) {
    return Corrupt(field, "the PNG does not start with its header");
  }
  if (width == 0 || height == 0 || width > kMaxSide || height > kMaxSide) {
    return Corrupt(field, "the PNG states an impossible size");
  }
  info.width = static_cast<int>(width);
  info.height = static_cast<int>(height);
  info.bit_depth = depth;
  while (chunk.type != "IDAT" && chunk.type != "IEND") {
    if (!ReadChunk(&reader, &chunk)) break;  // long image data: the header was whole before it
    if (chunk.type == "eXIf") info.orientation = ParseExifOrientation(chunk.data);
  }
  return info;
}

absl::Status CheckPngComplete(std::string_view bytes, std::string_view field) {
  ByteReader reader(bytes);
  reader.Skip(kPngMagic.size());
  PngChunk chunk;
  while (ReadChunk(&reader, &chunk)) {
    if (chunk.type == "IEND") return absl::OkStatus();
  }
  return Truncated(field);
}

}  // namespace litags
