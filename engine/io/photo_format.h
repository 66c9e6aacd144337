// The table of the photo formats that are read. One row and one file of code per format.
#ifndef LITAGS_ENGINE_IO_PHOTO_FORMAT_H_
#define LITAGS_ENGINE_IO_PHOTO_FORMAT_H_

#include <string>
#include <string_view>

#include "absl/status/statusor.h"
#include "engine/core/photo.h"
#include "engine/io/image_io.h"

namespace litags {

struct PhotoFormat {
  ImageFormat format;
  std::string_view name;  // in messages
  // By the first bytes, whatever the file is called.
  bool (*recognizes)(std::string_view bytes);
  // Size as stored, what EXIF says, bit depth. Checks no limits, and allocates no pixels.
  absl::StatusOr<ImageInfo> (*read_info)(std::string_view bytes, std::string_view field);
  // RGB as stored (not turned upright), in sRGB, of the size of `info`, which lies within limits.
  absl::StatusOr<Photo> (*decode)(std::string_view bytes, const ImageInfo& info,
                                  std::string_view field);
};

extern const PhotoFormat kJpegFormat;  // jpeg_decode.cc
extern const PhotoFormat kPngFormat;   // png_decode.cc
extern const PhotoFormat kRawFormat;   // raw_decode.cc
extern const PhotoFormat kTiffFormat;  // tiff_decode.cc
extern const PhotoFormat kWebpFormat;  // webp_decode.cc
extern const PhotoFormat kHeifFormat;  // heif_decode.cc
extern const PhotoFormat kJxlFormat;   // jxl_decode.cc

// "JPEG, PNG, ...": the names of all.
std::string PhotoFormatNames();

// nullptr: none of them.
const PhotoFormat* FindPhotoFormat(std::string_view bytes);

}  // namespace litags

#endif  // LITAGS_ENGINE_IO_PHOTO_FORMAT_H_
