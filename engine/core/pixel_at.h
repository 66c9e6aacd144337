// Which pixel of a picture a place lies in.
#ifndef LITAGS_ENGINE_CORE_PIXEL_AT_H_
#define LITAGS_ENGINE_CORE_PIXEL_AT_H_

#include <optional>

namespace litags {

struct PixelIndex {
  int x = 0, y = 0;
};

// The pixel at (x, y), px; nothing outside of the picture and of what is not a number. The place is
// compared before it is converted: what a number that no int holds becomes depends on the
// processor, and it may lie inside.
inline std::optional<PixelIndex> PixelAt(double x, double y, int width, int height) {
  if (!(x >= 0 && y >= 0 && x < width && y < height)) return std::nullopt;
  return PixelIndex{static_cast<int>(x), static_cast<int>(y)};
}

}  // namespace litags

#endif  // LITAGS_ENGINE_CORE_PIXEL_AT_H_
