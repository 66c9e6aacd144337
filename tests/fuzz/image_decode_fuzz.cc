// Whole photos of every format, and masks, within limits.
#include "engine/core/check.h"
#include "engine/io/image_io.h"
#include "engine/io/mask_io.h"
#include "tests/fuzz/fuzz_support.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace litags;
  // Small, so that many inputs a second are tried.
  const ImageLimits limits{.max_bytes = 1 << 20, .max_pixels = 1 << 16, .max_side = 1 << 10};
  const auto image = DecodeImage(AsText(data, size), "images[x]", limits);
  if (image.ok()) {
    LITAGS_CHECK(image->data.size() == size_t{3} * static_cast<size_t>(image->width) *
                                           static_cast<size_t>(image->height));
    LITAGS_CHECK(int64_t{image->width} * image->height <= limits.max_pixels);
  }
  const auto mask = DecodeMask(AsText(data, size), "masks[x]", limits);
  if (mask.ok()) {
    LITAGS_CHECK(image.ok() && mask->width == image->width && mask->height == image->height);
  }
  return 0;
}
