// What JPEG and PNG files say about themselves, read without decoding.
#ifndef LITAGS_ENGINE_IO_IMAGE_HEADER_H_
#define LITAGS_ENGINE_IO_IMAGE_HEADER_H_

#include <initializer_list>
#include <string>
#include <string_view>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "engine/io/image_io.h"

namespace litags {

// By their first bytes.
bool IsJpeg(std::string_view bytes);
bool IsPng(std::string_view bytes);

// Size as stored (not turned upright), what EXIF says, bit depth. Checks no limits. JPEG: reads
// up to the first scan. PNG: up to the first image data.
absl::StatusOr<ImageInfo> ParseJpegHeader(std::string_view bytes, std::string_view field);
absl::StatusOr<ImageInfo> ParsePngHeader(std::string_view bytes, std::string_view field);

// Whether a JPEG's data end without its end mark. It may stand amid the file: cameras append videos
// and small pictures.
bool LacksJpegEnd(std::string_view bytes);

// The ICC profile of a JPEG, put together from its segments; empty without one.
std::string JpegProfile(std::string_view bytes);

// Whether a JPEG's EXIF says that it is in Adobe RGB: what cameras write instead of a profile
// (DCF).
bool IsAdobeRgbByExif(std::string_view bytes);

// What a PNG says about its colours.
struct PngColors {
  bool is_grey = false;
  bool has_alpha = false;  // a channel, or one colour or entries of the palette
  bool is_srgb = false;
  std::string_view code_points;  // cICP; empty without it
  double gamma = 0;              // exponent from light to codes; 0: not said
  // What code 0 stands for where white, the largest, is 1. Below 0 in what EncodePng16 wrote of a
  // photo with samples below black.
  double least = 0;
  std::string_view deflated_profile;  // ICC, by zlib; empty without one
};
PngColors ReadPngColors(std::string_view bytes);

// The data of the chunk that says so: pCAL, calibration of pixel values, of the PNG extensions.
std::string PngCalibration(double least);

// Walks a PNG's chunks: IMAGE_TRUNCATED unless they are whole up to IEND.
absl::Status CheckPngComplete(std::string_view bytes, std::string_view field);

// ImageInfo::camera of what a file says; empty if it says nothing.
std::string CameraName(std::initializer_list<std::string_view> parts);

// Orientation, camera, focal length and exposure of an EXIF block ("II*\0..." or "MM\0*...", behind
// "Exif\0\0" or not), where it holds them and `info` has none yet. What is broken is passed over.
void ReadExif(std::string_view tiff, ImageInfo* info);

}  // namespace litags

#endif  // LITAGS_ENGINE_IO_IMAGE_HEADER_H_
