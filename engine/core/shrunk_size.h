// The size of a picture that must not exceed a number of pixels a side.
#ifndef LITAGS_ENGINE_CORE_SHRUNK_SIZE_H_
#define LITAGS_ENGINE_CORE_SHRUNK_SIZE_H_

#include <algorithm>
#include <cmath>

namespace litags {

struct PictureSize {
  int width = 0, height = 0;  // px
};

// The size of a picture of `width` x `height` px with its longer side at most `max_side` px (0:
// any) and its shape kept. A side has at least 1 px.
inline PictureSize ShrunkSize(int width, int height, int max_side) {
  const int longer = std::max(width, height);
  if (max_side <= 0 || longer <= max_side) return {width, height};
  const double scale = double(max_side) / longer;
  return {std::max(1, static_cast<int>(std::lround(scale * width))),
          std::max(1, static_cast<int>(std::lround(scale * height)))};
}

}  // namespace litags

#endif  // LITAGS_ENGINE_CORE_SHRUNK_SIZE_H_
