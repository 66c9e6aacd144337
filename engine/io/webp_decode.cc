// WebP stills, by libwebp: 8 bits of RGB if lossless, of YCbCr if lossy.
#include <webp/decode.h>

#include <array>
#include <vector>

#include "engine/io/byte_reader.h"
#include "engine/io/color_space.h"
#include "engine/io/image_header.h"
#include "engine/io/io_error.h"
#include "engine/io/photo_format.h"
#include "engine/io/ycbcr.h"

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

// The planes of a lossy picture; empty if it cannot be decoded.
std::vector<uint8_t> DecodePlanes(std::string_view bytes, int width, int height,
                                  std::array<ComponentView<uint8_t>, 3>* planes) {
  WebPDecoderConfig config;
  WebPInitDecoderConfig(&config);
  const int half_width = (width + 1) / 2, half_height = (height + 1) / 2;
  const size_t luma = size_t(width) * height, chroma = size_t(half_width) * half_height;
  std::vector<uint8_t> all(luma + 2 * chroma);
  uint8_t *cb = all.data() + luma, *cr = cb + chroma;
  config.output.colorspace = MODE_YUV;
  config.output.is_external_memory = 1;
  config.output.u.YUVA = {all.data(), cb, cr,   nullptr, width,  half_width,
                          half_width, 0,  luma, chroma,  chroma, 0};
  if (WebPDecode(Data(bytes), bytes.size(), &config) != VP8_STATUS_OK) return {};
  *planes = {{{all.data(), width, height, width},
              {cb, half_width, half_height, half_width},
              {cr, half_width, half_height, half_width}}};
  return all;
}

// VP8: BT.601 of limited range, chroma halved both ways.
bool DecodeLossy(std::string_view bytes, const ColorSpace& space, Photo* photo) {
  const int width = photo->width, height = photo->height;
  std::array<ComponentView<uint8_t>, 3> planes;
  const std::vector<uint8_t> memory = DecodePlanes(bytes, width, height, &planes);
  if (memory.empty()) return false;
  std::vector<Upsampler<uint8_t>> upsamplers;
  std::array<std::vector<float>, 3> rows;
  for (int c = 0; c < 3; ++c) {
    const double ratio = c == 0 ? 1 : 0.5;
    upsamplers.emplace_back(planes[c], TapsOf(width, planes[c].width, ratio),
                            TapsOf(height, planes[c].height, ratio));
    rows[c].resize(width);
  }
  const YCbCrToRgb conversion({.full_range = false});
  std::vector<float> rgb(size_t{3} * width);
  for (int y = 0; y < height; ++y) {
    for (int c = 0; c < 3; ++c) upsamplers[c].Row(y, rows[c].data());
    conversion.Convert(rows[0].data(), rows[1].data(), rows[2].data(), width, rgb.data());
    space.Convert(rgb.data(), width, photo->pixel(0, y));
  }
  return true;
}

bool DecodeLossless(std::string_view bytes, const ColorSpace& space, Photo* photo) {
  const size_t row = size_t{3} * photo->width, all = row * photo->height;
  std::vector<uint8_t> rgb(all);
  if (WebPDecodeRGBInto(Data(bytes), bytes.size(), rgb.data(), all, static_cast<int>(row)) ==
      nullptr) {
    return false;
  }
  std::vector<float> codes(row);
  for (int y = 0; y < photo->height; ++y) {
    for (size_t i = 0; i < row; ++i) codes[i] = rgb[y * row + i] / 255.0f;
    space.Convert(codes.data(), photo->width, photo->pixel(0, y));
  }
  return true;
}

absl::StatusOr<Photo> DecodeWebp(std::string_view bytes, const ImageInfo& info,
                                 std::string_view field) {
  uint32_t size = 0;
  ByteReader reader(bytes);
  if (!reader.Skip(4) || !reader.Read(&size) || size > reader.remaining()) return Truncated(field);
  WebPBitstreamFeatures features;
  const bool known = WebPGetFeatures(Data(bytes), bytes.size(), &features) == VP8_STATUS_OK;
  const bool lossy = known && features.format == 1;  // by libwebp's documentation
  const ColorSpace space = ColorSpace::FromIccOrSrgb(FindChunk(bytes, "ICCP"), 3);
  Photo photo(info.width, info.height);
  if (!(lossy ? DecodeLossy : DecodeLossless)(bytes, space, &photo)) {
    return InvalidField("IMAGE_CORRUPT", field, "the WebP cannot be decoded; send the file again");
  }
  return photo;
}

}  // namespace

const PhotoFormat kWebpFormat = {ImageFormat::kWebp, "WebP", IsWebp, ReadWebpInfo, DecodeWebp};

}  // namespace litags
