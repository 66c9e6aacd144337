// Headers of photos: all that is looked at before a size limit is known to hold.
#include "engine/core/check.h"
#include "engine/io/image_header.h"
#include "engine/io/image_io.h"
#include "tests/fuzz/fuzz_support.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace litags;
  const std::string_view bytes = AsText(data, size);
  const ImageLimits limits;
  if (const auto info = ReadImageInfo(bytes, "images[x]", limits); info.ok()) {
    LITAGS_CHECK(info->width > 0 && info->width <= limits.max_side);
    LITAGS_CHECK(info->height > 0 && info->height <= limits.max_side);
    LITAGS_CHECK(int64_t{info->width} * info->height <= limits.max_pixels);
    LITAGS_CHECK(info->orientation >= 1 && info->orientation <= 8);
  }
  ParseJpegHeader(bytes, "x").status().IgnoreError();
  ParsePngHeader(bytes, "x").status().IgnoreError();
  CheckPngComplete(bytes, "x").IgnoreError();
  ImageInfo info;
  ReadExif(bytes, &info);
  LITAGS_CHECK(info.orientation >= 1 && info.orientation <= 8);
  LITAGS_CHECK(info.focal_length >= 0 && info.focal_length < 1e10);
  return 0;
}
