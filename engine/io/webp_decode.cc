// WebP stills, by libwebp: 8 bits.
#include <webp/decode.h>

#include <string>
#include <vector>

#include "engine/io/byte_reader.h"
#include "engine/io/color_space.h"
#include "engine/io/image_header.h"
#include "engine/io/io_error.h"
#include "engine/io/photo_format.h"

namespace litags {
namespace {

constexpr size_t kHeaderSize = 12;  // "RIFF", size, "WEBP"

const uint8_t* Data(std::string_view bytes) {
  return reinterpret_cast<const uint8_t*>(bytes.data());
}

bool IsWebp(std::string_view bytes) {
  return bytes.starts_with("RIFF") && bytes.substr(0, kHeaderSize).ends_with("WEBP") &&
         bytes.size() >= kHeaderSize;
}

// The first chunk of a type; empty without one.
std::string_view FindChunk(std::string_view bytes, std::string_view type) {
  ByteReader reader(bytes);
  reader.Skip(kHeaderSize);
  std::string_view name, data;
  uint32_t size = 0;
  while (reader.ReadBytes(4, &name) && reader.Read(&size) && reader.ReadBytes(size, &data)) {
    if (name == type) return data;
    if (size % 2 == 1 && !reader.Skip(1)) break;
  }
  return "";
}

absl::Status Truncated(std::string_view field) {
  return InvalidField("IMAGE_TRUNCATED", field, "the WebP ends early; send the whole file again");
}

absl::StatusOr<ImageInfo> ReadWebpInfo(std::string_view bytes, std::string_view field) {
  WebPBitstreamFeatures features;
  const VP8StatusCode status = WebPGetFeatures(Data(bytes), bytes.size(), &features);
  if (status == VP8_STATUS_NOT_ENOUGH_DATA) return Truncated(field);
  if (status != VP8_STATUS_OK) {
    return InvalidField("IMAGE_CORRUPT", field, "the WebP's header is broken; send the file again");
  }
  if (features.has_animation) {
    return InvalidField("IMAGE_UNSUPPORTED", field,
                        "an animated WebP; send its frames as photos of their own");
  }
  ImageInfo info;
  info.format = ImageFormat::kWebp;
  info.width = features.width;
  info.height = features.height;
  ReadExif(FindChunk(bytes, "EXIF"), &info);
  return info;
}

absl::StatusOr<Photo> DecodeWebp(std::string_view bytes, const ImageInfo& info,
                                 std::string_view field) {
  uint32_t size = 0;
  ByteReader reader(bytes);
  if (!reader.Skip(4) || !reader.Read(&size) || size > reader.remaining()) return Truncated(field);
  const size_t row = size_t{3} * info.width, all = row * info.height;
  std::vector<uint8_t> rgb(all);
  if (WebPDecodeRGBInto(Data(bytes), bytes.size(), rgb.data(), all, static_cast<int>(row)) ==
      nullptr) {
    return InvalidField("IMAGE_CORRUPT", field, "the WebP cannot be decoded; send the file again");
  }
  const ColorSpace space = ColorSpace::FromIccOrSrgb(FindChunk(bytes, "ICCP"), 3);
  Photo photo(info.width, info.height);
  std::vector<float> codes(row);
  for (int y = 0; y < info.height; ++y) {
    for (size_t i = 0; i < row; ++i) codes[i] = rgb[y * row + i] / 255.0f;
    space.Convert(codes.data(), info.width, photo.pixel(0, y));
  }
  return photo;
}

}  // namespace

const PhotoFormat kWebpFormat = {ImageFormat::kWebp, "WebP", IsWebp, ReadWebpInfo, DecodeWebp};

}  // namespace litags
