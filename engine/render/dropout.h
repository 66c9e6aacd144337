#ifndef LITAGS_ENGINE_RENDER_DROPOUT_H_
#define LITAGS_ENGINE_RENDER_DROPOUT_H_

#include <cstddef>
#include <cstdint>

#include "engine/core/rng.h"
#include "engine/core/splats.h"

namespace litags {

// Leaves a share of the Gaussians out of a view and divides the opacity of the others by
// 1 - share, before the clamp at 0.99, so that none can lean on exactly those behind and beside it
// (DropGaussian, arXiv 2504.00773, Sec. 3.2).
struct Dropout {
  double share = 0;      // [0, 1)
  CounterRng rng{0, 0};  // draws them: a function of the Gaussian's index

  // Bit i is set if Gaussian 16 block + i is left out.
  uint32_t LeftOut(size_t block) const {
    static_assert(kSplatBlock == 16);
    if (share == 0) return 0;
    const auto threshold = static_cast<uint64_t>(share * 65536);
    uint32_t lanes = 0;
    for (int i = 0; i < 16; i += 4) {  // 16 random bits a Gaussian
      uint64_t bits = rng.Bits(4 * block + i / 4);
      for (int k = 0; k < 4; ++k, bits >>= 16) {
        lanes |= uint32_t{(bits & 0xFFFF) < threshold} << (i + k);
      }
    }
    return lanes;
  }
};

}  // namespace litags

#endif  // LITAGS_ENGINE_RENDER_DROPOUT_H_
