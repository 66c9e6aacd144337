#include "engine/io/alpha_mask.h"

#include "engine/core/mask.h"
#include "engine/io/image_header.h"
#include "engine/io/image_io.h"
#include "engine/io/png_codes.h"

namespace litags {

PlaneU8 AlphaMask(std::string_view bytes, int orientation) {
  if (!IsPng(bytes) || !ReadPngColors(bytes).has_alpha) return {};
  PlaneU8 mask;
  const auto take = [&](const PngShape& shape, int y, const uint16_t* codes) {
    if (y == 0) mask = PlaneU8(shape.width, shape.height);
    for (int x = 0; x < shape.width; ++x) {
      const int alpha = codes[(x + 1) * shape.channels - 1];
      mask.data[size_t(y) * shape.width + x] = 2 * alpha >= shape.white ? kCounts : 0;
    }
  };
  if (!ReadPngCodes(bytes, PngChannels::kAll, "photo", take).ok()) return {};
  const size_t counted = CountedPixels(mask, mask.data.size());
  if (counted == 0 || counted == mask.data.size()) return {};
  return TurnUpright(mask, orientation);
}

}  // namespace litags
