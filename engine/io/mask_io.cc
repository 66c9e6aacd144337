#include "engine/io/mask_io.h"

#include <algorithm>
#include <utility>

#include "absl/strings/ascii.h"
#include "engine/core/mask.h"
#include "engine/io/file_util.h"
#include "engine/io/io_error.h"
#include "engine/io/png_codes.h"

namespace litags {
namespace {

bool IsMaskName(const std::string& name) {
  return name.size() > 4 && name.front() != '.' &&
         absl::AsciiStrToLower(name.substr(name.size() - 4)) == ".png";
}

absl::Status CheckFormat(const ImageInfo& info, std::string_view field) {
  if (info.format != ImageFormat::kPng) {
    return InvalidField("MASK_FORMAT", field,
                        "a mask must be a PNG: JPEG does not keep zeros; save it as PNG");
  }
  if (info.bit_depth > 8) {
    return InvalidField("MASK_FORMAT", field,
                        absl::StrCat("the mask has ", info.bit_depth,
                                     " bits a channel, at most 8 are taken; save it with 8"));
  }
  return absl::OkStatus();
}

// The codes as they are in the file: to a profile's curve, 1 of 255 is as black as 0. Alpha does
// not count, but where colour masks nothing and alpha is not opaque, it is alpha that was meant.
absl::StatusOr<PlaneU8> DecodeNotZero(std::string_view bytes, const ImageInfo& info,
                                      std::string_view field) {
  PlaneU8 mask;
  bool opaque = true;
  const auto take = [&](const PngShape& shape, int y, const uint16_t* codes) {
    if (y == 0) mask = PlaneU8(shape.width, shape.height);
    const bool has_alpha = shape.channels % 2 == 0;
    const int colors = shape.channels - (has_alpha ? 1 : 0);
    for (int x = 0; x < shape.width; ++x, codes += shape.channels) {
      const bool counts =
          std::any_of(codes, codes + colors, [](uint16_t code) { return code != 0; });
      mask.data[size_t(y) * shape.width + x] = counts ? kCounts : 0;
      opaque = opaque && (!has_alpha || codes[colors] == shape.white);
    }
  };
  LITAGS_RETURN_IF_ERROR(ReadPngCodes(bytes, PngChannels::kAll, field, take));
  if (!opaque && CountedPixels(mask, mask.data.size()) == mask.data.size()) {
    return InvalidField(
        "MASK_FORMAT", field,
        "the mask's colours are nowhere 0, so all of the photo would count, but its "
        "alpha channel is not opaque; save what it says as grey: 0 is what does not "
        "count");
  }
  return TurnUpright(std::move(mask), info.orientation);
}

}  // namespace

absl::StatusOr<MaskPaths> FindMasks(const std::string& dir, absl::Span<const std::string> photos) {
  return FindMasks(dir, photos, {});
}

absl::StatusOr<MaskPaths> FindMasks(const std::string& dir, absl::Span<const std::string> photos,
                                    const std::set<std::string>& known) {
  LITAGS_ASSIGN_OR_RETURN(std::vector<std::string> names, ListFiles(dir, "masks", IsMaskName));
  if (names.empty()) {
    return InvalidField(
        "NO_MASKS", "masks",
        absl::StrCat("the folder '", dir, "' holds no .png file; name masks <photo's name>.png"));
  }
  std::erase_if(names, [&](const std::string& name) { return known.contains(name); });
  LITAGS_ASSIGN_OR_RETURN(const auto mask_of, MatchMasks(photos, names));
  MaskPaths paths;
  for (const auto& [photo, mask] : mask_of) paths[photo] = absl::StrCat(dir, "/", mask);
  return paths;
}

absl::StatusOr<PlaneU8> DecodeMask(std::string_view bytes, std::string_view field,
                                   const ImageLimits& limits) {
  LITAGS_ASSIGN_OR_RETURN(const ImageInfo info, ReadImageInfo(bytes, field, limits));
  LITAGS_RETURN_IF_ERROR(CheckFormat(info, field));
  LITAGS_ASSIGN_OR_RETURN(PlaneU8 mask, DecodeNotZero(bytes, info, field));
  if (CountedPixels(mask, mask.data.size()) > 0) return mask;
  return InvalidField("MASK_BLACK", field,
                      "every pixel of the mask is 0, nothing of the photo counts; leave the photo "
                      "out, or turn the mask around: 0 is what does not count");
}

absl::StatusOr<PlaneU8> ReadMask(const std::string& path, int photo_width, int photo_height) {
  const std::string field = absl::StrCat("masks[", BaseName(path), "]");
  LITAGS_ASSIGN_OR_RETURN(const std::string bytes, ReadFile(path, field, ImageLimits().max_bytes));
  LITAGS_ASSIGN_OR_RETURN(const ImageInfo info, ReadImageInfo(bytes, field));
  LITAGS_RETURN_IF_ERROR(
      CheckMaskSize(BaseName(path), info.width, info.height, photo_width, photo_height));
  return DecodeMask(bytes, field);
}

absl::StatusOr<MaskedPhoto> ReadMaskedPhoto(const std::string& path, std::string_view field,
                                            const std::string& mask_path) {
  MaskedPhoto read;
  LITAGS_ASSIGN_OR_RETURN(const std::string photo, ReadFile(path, field, ImageLimits().max_bytes));
  LITAGS_ASSIGN_OR_RETURN(read.info, ReadImageInfo(photo, field));
  LITAGS_ASSIGN_OR_RETURN(read.photo, DecodePhoto(photo, field));
  if (mask_path.empty()) return read;
  LITAGS_ASSIGN_OR_RETURN(read.mask, ReadMask(mask_path, read.photo.width, read.photo.height));
  FillMasked(read.mask, &read.photo);
  return read;
}

absl::StatusOr<std::string> EncodeMask(const PlaneU8& mask) {
  return EncodePngCodes(mask.data.data(), mask.width, mask.height, 1);
}

}  // namespace litags
