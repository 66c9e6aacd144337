#include "engine/io/photo_format.h"

#include "absl/strings/str_join.h"

namespace litags {
namespace {

// RAW before TIFF: most RAW files are TIFF files, too.
constexpr const PhotoFormat* kFormats[] = {&kJpegFormat, &kPngFormat,  &kRawFormat, &kTiffFormat,
                                           &kWebpFormat, &kHeifFormat, &kJxlFormat};

// How names end, lower case.
constexpr std::string_view kEndings[] = {".jpg",  ".jpeg", ".jpe",  ".jfif", ".png", ".tif",
                                         ".tiff", ".webp", ".heic", ".heif", ".hif", ".avif",
                                         ".jxl",  ".dng",  ".nef",  ".nrw",  ".cr2", ".cr3",
                                         ".arw",  ".raf",  ".orf",  ".rw2",  ".pef", ".srw"};

}  // namespace

std::span<const std::string_view> PhotoEndings() { return kEndings; }

std::string PhotoFormatNames() {
  return absl::StrJoin(kFormats, ", ", [](std::string* out, const PhotoFormat* format) {
    out->append(format->name);
  });
}

const PhotoFormat* FindPhotoFormat(std::string_view bytes) {
  for (const PhotoFormat* format : kFormats) {
    if (format->recognizes(bytes)) return format;
  }
  return nullptr;
}

}  // namespace litags
