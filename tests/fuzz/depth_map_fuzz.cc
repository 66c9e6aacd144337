// Depth maps: PFM, NPY and 16-bit PNG; and NPY arrays of any shape.
#include "engine/core/check.h"
#include "engine/io/depth_io.h"
#include "engine/io/npy.h"
#include "tests/fuzz/fuzz_support.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace litags;
  const std::string_view bytes = AsText(data, size);
  const ImageLimits limits{.max_bytes = 1 << 20, .max_pixels = 1 << 16, .max_side = 1 << 10};
  if (const auto map = DecodeDepthMap(bytes, "depth[x]", limits); map.ok()) {
    LITAGS_CHECK(map->channels == 1 && map->width > 0 && map->height > 0);
    LITAGS_CHECK(int64_t{map->width} * map->height <= limits.max_pixels);
    const auto size = ParseDepthSize(bytes, "depth[x]");
    LITAGS_CHECK(size.ok() && size->width == map->width && size->height == map->height);
  }
  if (const auto array = DecodeNpy(bytes, "x"); array.ok()) {
    LITAGS_CHECK(array->ToDoubles().size() == static_cast<size_t>(array->size()));
  }
  return 0;
}
