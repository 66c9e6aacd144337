// PNG of 8 and 16 bits, by libpng.
#include <zlib.h>

#include <cmath>
#include <optional>
#include <string>
#include <vector>

#include "engine/io/color_space.h"
#include "engine/io/image_header.h"
#include "engine/io/io_error.h"
#include "engine/io/photo_format.h"
#include "engine/io/png_codes.h"

namespace litags {
namespace {

std::string Inflate(std::string_view deflated) {
  std::string out;
  // The size is not said, and most profiles are small. A bomb has more than any may.
  for (size_t size = size_t{64} << 10; size <= kMaxProfileBytes; size *= 2) {
    out.resize(size);
    uLongf written = size;
    const int result = uncompress(reinterpret_cast<Bytef*>(out.data()), &written,
                                  reinterpret_cast<const Bytef*>(deflated.data()), deflated.size());
    if (result == Z_OK) return out.substr(0, written);
    if (result != Z_BUF_ERROR) break;
  }
  return "";
}

absl::StatusOr<ColorSpace> ColorSpaceOf(const PngColors& colors, std::string_view field) {
  constexpr double kUsual = 1 / 2.2;     // is written for sRGB
  if (colors.code_points.size() == 4) {  // primaries, curve, matrix (none), full range
    const auto number = [&](int i) { return static_cast<uint8_t>(colors.code_points[i]); };
    if (number(3) == 0) {
      return InvalidField("IMAGE_UNSUPPORTED", field,
                          "a PNG of limited range; save it with full range");
    }
    return ColorSpace::FromCodePoints(number(0), number(1), field);
  }
  if (!colors.deflated_profile.empty()) {
    const std::string icc = Inflate(colors.deflated_profile);
    const std::optional<ColorSpace> space = ColorSpace::FromIcc(icc, colors.is_grey ? 1 : 3);
    return space.value_or(ColorSpace::Srgb(3));
  }
  const bool said = !colors.is_srgb && colors.gamma > 0.1 && colors.gamma < 10;
  if (!said || std::abs(colors.gamma - kUsual) < 0.02) return ColorSpace::Srgb(3);
  return ColorSpace::Gamma(1 / colors.gamma, 3);
}

absl::StatusOr<Photo> DecodePng(std::string_view bytes, const ImageInfo& info,
                                std::string_view field) {
  const PngColors colors = ReadPngColors(bytes);
  LITAGS_ASSIGN_OR_RETURN(const ColorSpace space, ColorSpaceOf(colors, field));
  const auto least = static_cast<float>(colors.least);
  Photo photo(info.width, info.height);
  const int n = space.channels();
  std::vector<float> row(size_t(n) * photo.width);
  const auto take = [&](const PngShape& shape, int y, const uint16_t* codes) {
    const auto white = static_cast<float>(shape.white);
    for (int x = 0; x < photo.width; ++x) {
      for (int c = 0; c < n; ++c) row[n * x + c] = least + (1 - least) * (codes[3 * x + c] / white);
    }
    space.Convert(row.data(), photo.width, photo.pixel(0, y));
  };
  LITAGS_RETURN_IF_ERROR(ReadPngCodes(bytes, PngChannels::kColor, field, take));
  return photo;
}

}  // namespace

const PhotoFormat kPngFormat = {ImageFormat::kPng, "PNG", IsPng, ParsePngHeader, DecodePng};

}  // namespace litags
