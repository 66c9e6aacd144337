#include "engine/io/image_io.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <span>
#include <utility>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/str_join.h"
#include "engine/core/check.h"
#include "engine/core/shrunk_size.h"
#include "engine/io/file_util.h"
#include "engine/io/image_header.h"
#include "engine/io/io_error.h"
#include "engine/io/photo_format.h"
#include "engine/io/png_codes.h"

namespace litags {
namespace {

absl::Status CheckLimits(const ImageInfo& info, std::string_view field, const ImageLimits& limits) {
  const int64_t pixels = int64_t{info.width} * info.height;
  if (info.width <= limits.max_side && info.height <= limits.max_side &&
      pixels <= limits.max_pixels) {
    return absl::OkStatus();
  }
  return InvalidField("IMAGE_TOO_LARGE", field,
                      absl::StrCat(info.width, "x", info.height, " px exceeds ", limits.max_pixels,
                                   " pixels or ", limits.max_side, " px on a side; resize it"));
}

// Size as stored, limits checked.
absl::StatusOr<ImageInfo> ReadStoredInfo(std::string_view bytes, std::string_view field,
                                         const ImageLimits& limits, const PhotoFormat** format) {
  if (bytes.empty()) {
    return InvalidField("IMAGE_EMPTY", field, "the file has zero bytes; send it again");
  }
  if (static_cast<int64_t>(bytes.size()) > limits.max_bytes) {
    return InvalidField("IMAGE_TOO_LARGE", field,
                        absl::StrCat(bytes.size(), " bytes exceed the limit of ", limits.max_bytes,
                                     " bytes; resize or recompress it"));
  }
  *format = FindPhotoFormat(bytes);
  if (*format == nullptr) {
    return InvalidField("IMAGE_NOT_RECOGNIZED", field,
                        absl::StrCat("it is of none of the formats that are read (",
                                     PhotoFormatNames(), "); convert it to JPEG or PNG"));
  }
  LITAGS_ASSIGN_OR_RETURN(const ImageInfo info, (*format)->read_info(bytes, field));
  LITAGS_RETURN_IF_ERROR(CheckLimits(info, field, limits));
  return info;
}

// The picture that EXIF's orientation, 1..8, says is meant; `copy` takes a pixel of the first to
// one of the second, both by their index.
template <class Picture, class CopyPixel>
Picture Turned(Picture stored, int orientation, CopyPixel copy) {
  if (orientation == 1) return stored;
  const bool swap = orientation >= 5;
  const bool mirror_x =
      orientation == 2 || orientation == 3 || orientation == 7 || orientation == 8;
  const bool mirror_y =
      orientation == 3 || orientation == 4 || orientation == 6 || orientation == 7;
  Picture out(swap ? stored.height : stored.width, swap ? stored.width : stored.height);
  for (int y = 0; y < out.height; ++y) {
    for (int x = 0; x < out.width; ++x) {
      int sx = swap ? y : x, sy = swap ? x : y;
      if (mirror_x) sx = stored.width - 1 - sx;
      if (mirror_y) sy = stored.height - 1 - sy;
      copy(stored, size_t(sy) * stored.width + sx, out, size_t(y) * out.width + x);
    }
  }
  return out;
}

// EXIF orientations 5..8 swap the axes.
ImageInfo Upright(ImageInfo info) {
  if (info.orientation >= 5) std::swap(info.width, info.height);
  return info;
}

bool EndsWithOneOf(std::span<const std::string_view> suffixes, const std::string& name) {
  const std::string lower = absl::AsciiStrToLower(name);
  return !name.starts_with('.') && std::ranges::any_of(suffixes, [&](std::string_view suffix) {
    return lower.size() > suffix.size() && std::string_view(lower).ends_with(suffix);
  });
}

std::string JoinedEndings() {
  return absl::StrJoin(PhotoEndings(), " ",
                       [](std::string* out, std::string_view ending) { out->append(ending); });
}

bool IsOtherPictureName(const std::string& name) {
  constexpr std::string_view kOther[] = {".bmp", ".gif", ".exr", ".hdr", ".jp2", ".pgm",
                                         ".ppm", ".psd", ".tga", ".crw", ".3fr", ".x3f"};
  return EndsWithOneOf(kOther, name);
}

}  // namespace

absl::StatusOr<ImageInfo> ReadImageInfo(std::string_view bytes, std::string_view field,
                                        const ImageLimits& limits) {
  const PhotoFormat* format = nullptr;
  LITAGS_ASSIGN_OR_RETURN(const ImageInfo info, ReadStoredInfo(bytes, field, limits, &format));
  return Upright(info);
}

Photo TurnUpright(Photo stored, int orientation) {
  return Turned(std::move(stored), orientation,
                [](const Photo& from, size_t i, Photo& to, size_t j) {
                  std::copy_n(&from.data[3 * i], 3, &to.data[3 * j]);
                });
}

PlaneU8 TurnUpright(PlaneU8 stored, int orientation) {
  return Turned(
      std::move(stored), orientation,
      [](const PlaneU8& from, size_t i, PlaneU8& to, size_t j) { to.data[j] = from.data[i]; });
}

absl::StatusOr<Photo> DecodePhoto(std::string_view bytes, std::string_view field,
                                  const ImageLimits& limits) {
  const PhotoFormat* format = nullptr;
  LITAGS_ASSIGN_OR_RETURN(const ImageInfo info, ReadStoredInfo(bytes, field, limits, &format));
  LITAGS_ASSIGN_OR_RETURN(Photo stored, format->decode(bytes, info, field));
  return TurnUpright(std::move(stored), info.orientation);
}

absl::StatusOr<ImageU8> DecodeImage(std::string_view bytes, std::string_view field,
                                    const ImageLimits& limits) {
  LITAGS_ASSIGN_OR_RETURN(const Photo photo, DecodePhoto(bytes, field, limits));
  return PhotoToU8(photo);
}

absl::StatusOr<Photo> ReadPhoto(const std::string& path, std::string_view field) {
  LITAGS_ASSIGN_OR_RETURN(const std::string bytes, ReadFile(path, field, ImageLimits().max_bytes));
  return DecodePhoto(bytes, field);
}

absl::StatusOr<ImageU8> ReadImage(const std::string& path, std::string_view field) {
  LITAGS_ASSIGN_OR_RETURN(const Photo photo, ReadPhoto(path, field));
  return PhotoToU8(photo);
}

absl::StatusOr<ImageInfo> ReadImageSize(const std::string& path, std::string_view field) {
  LITAGS_ASSIGN_OR_RETURN(const std::string bytes, ReadFile(path, field, ImageLimits().max_bytes));
  return ReadImageInfo(bytes, field);
}

absl::StatusOr<std::string> EncodePng(const ImageU8& image) {
  return EncodePngCodes(image.data.data(), image.width, image.height, 3);
}

int SignificantBits(const ImageInfo& info) {
  return info.significant_bits > 0 ? info.significant_bits : info.bit_depth;
}

double CodeStep(const ImageInfo& info) {
  return std::min(1.0, 255 / (std::exp2(SignificantBits(info)) - 1));
}

absl::StatusOr<std::string> EncodePng16(const Planes& plane, double scale) {
  if (plane.channels > 1) {
    return InvalidInput("COUNT_MISMATCH", "image",
                        absl::StrCat(plane.channels, " planes; a 16-bit PNG takes one"));
  }
  std::vector<uint16_t> codes(plane.data.size());
  std::ranges::transform(plane.data, codes.begin(), [&](float value) {
    const double code = value * scale;
    // The comparison is false for NaN.
    return code > 0 ? static_cast<uint16_t>(std::min(code + 0.5, 65535.0)) : 0;
  });
  return EncodePngCodes(codes.data(), plane.width, plane.height, 1);
}

absl::StatusOr<std::string> EncodePng16(const Photo& photo, int significant_bits) {
  constexpr int kWhite = (1 << kPng16Bits) - 1;
  const int least = photo.empty()
                        ? 0
                        : std::clamp<int>(*std::min_element(photo.data.begin(), photo.data.end()),
                                          -kPhotoWhite, 0);
  // The code of 0: as many are below it as the least sample wants, rounded up.
  const int black = (-least * kWhite + kPhotoWhite - least - 1) / (kPhotoWhite - least);
  std::vector<uint16_t> codes(photo.data.size());
  for (size_t i = 0; i < codes.size(); ++i) {
    const int sample = std::clamp<int>(photo.data[i], least, kPhotoWhite);
    const int code =
        (sample * (kWhite - black) + kPhotoWhite * black + kPhotoWhite / 2) / kPhotoWhite;
    codes[i] = static_cast<uint16_t>(code << 4 | code >> 8);
  }
  LITAGS_ASSIGN_OR_RETURN(std::string png, EncodePngCodes(codes.data(), photo.width, photo.height,
                                                          3, PngSpeed::kPhoto));
  if (black > 0) {
    png = WithPngChunk(std::move(png), "pCAL", PngCalibration(-black / double(kWhite - black)));
  }
  return WithPngChunk(std::move(png), "sBIT",
                      std::string(3, static_cast<char>(std::min(significant_bits, kPng16Bits))));
}

absl::Status WritePng(const std::string& path, const ImageU8& image) {
  LITAGS_ASSIGN_OR_RETURN(const std::string bytes, EncodePng(image));
  return WriteFileAtomically(path, bytes);
}

absl::Status WriteJpeg(const std::string& path, const ImageU8& image, int quality) {
  LITAGS_ASSIGN_OR_RETURN(const std::string bytes, EncodeJpeg(image, quality));
  return WriteFileAtomically(path, bytes);
}

absl::Status WritePng16(const std::string& path, const Planes& plane) {
  LITAGS_ASSIGN_OR_RETURN(const std::string bytes, EncodePng16(plane));
  return WriteFileAtomically(path, bytes);
}

bool IsPhotoName(const std::string& name) { return EndsWithOneOf(PhotoEndings(), name); }

absl::StatusOr<std::vector<std::string>> ListPhotos(const std::string& dir,
                                                    std::string_view field) {
  LITAGS_ASSIGN_OR_RETURN(std::vector<std::string> names, ListFiles(dir, field, IsPhotoName));
  if (names.empty()) {
    LITAGS_ASSIGN_OR_RETURN(const std::string others, DescribeOtherPictures(dir, field));
    return InvalidField(
        "NO_PHOTOS", field,
        absl::StrCat("the folder '", dir, "' holds no photo (", JoinedEndings(), "); ",
                     others.empty() ? "give the folder that holds the photos" : others));
  }
  return names;
}

absl::StatusOr<std::string> DescribeOtherPictures(const std::string& dir, std::string_view field) {
  LITAGS_ASSIGN_OR_RETURN(const std::vector<std::string> names,
                          ListFiles(dir, field, IsOtherPictureName));
  if (names.empty()) return "";
  return absl::StrCat(names.size(), names.size() == 1 ? " picture is" : " pictures are",
                      " of a kind that is not read, ", names.front(),
                      names.size() == 1 ? "" : " for one", ": convert to JPEG or PNG");
}

ImageU8 ResizeArea(const ImageU8& image, int width, int height) {
  LITAGS_CHECK(width > 0 && height > 0 && !image.empty());
  if (width == image.width && height == image.height) return image;
  const cv::Mat in(image.height, image.width, CV_8UC3, const_cast<uint8_t*>(image.data.data()));
  ImageU8 out(width, height);
  cv::Mat resized(height, width, CV_8UC3, out.data.data());
  cv::resize(in, resized, resized.size(), 0, 0, cv::INTER_AREA);
  return out;
}

Photo ResizeArea(const Photo& photo, int width, int height) {
  LITAGS_CHECK(width > 0 && height > 0 && !photo.empty());
  if (width == photo.width && height == photo.height) return photo;
  cv::Mat light(photo.height, photo.width, CV_32FC3), resized;
  std::transform(photo.data.begin(), photo.data.end(), light.ptr<float>(),
                 std::cref(LinearTable::Get()));
  cv::resize(light, resized, cv::Size(width, height), 0, 0, cv::INTER_AREA);
  Photo out(width, height);
  std::transform(resized.ptr<float>(), resized.ptr<float>() + out.data.size(), out.data.begin(),
                 std::cref(SampleTable::Get()));
  return out;
}

Photo ShrinkToFit(const Photo& photo, int side) {
  const PictureSize size = ShrunkSize(photo.width, photo.height, side);
  return ResizeArea(photo, size.width, size.height);
}

}  // namespace litags
