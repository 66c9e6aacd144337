// Inside this module: many values as few, for SOG.
#ifndef LITAGS_ENGINE_EXPORT_CODEBOOK_H_
#define LITAGS_ENGINE_EXPORT_CODEBOOK_H_

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "engine/core/cancel.h"

namespace litags {

// 256 values, rising, that lie near all of `values`: Lloyd's rule for one dimension.
class Codebook {
 public:
  explicit Codebook(std::vector<float> values);
  const std::array<float, 256>& values() const { return values_; }
  uint8_t Nearest(float value) const;

 private:
  std::array<float, 256> values_{};
};

// Groups of points that are much the same.
struct Palette {
  std::vector<float> centers;    // [count, dimensions]
  std::vector<uint16_t> labels;  // of each point
  size_t count = 0;
};

// At most `count` groups (and 65536) of `points`, [n, dimensions]: the group whose points lie
// farthest from its centre is halved, until there are enough. No point's place depends on threads.
// Once the token is raised, those there are must do.
Palette MakePalette(const std::vector<float>& points, int dimensions, size_t count,
                    const CancelToken& cancel = {});

}  // namespace litags

#endif  // LITAGS_ENGINE_EXPORT_CODEBOOK_H_
