// Compositing one 16x16 tile, forward and backward. Vectors run across pixels: each covers a
// block of 4 x (lanes / 4) pixels, and a bit mask per Gaussian says which blocks its ellipse
// reaches.
#ifndef LITAGS_ENGINE_RENDER_RASTERIZE_H_
#define LITAGS_ENGINE_RENDER_RASTERIZE_H_

#include <cstddef>
#include <cstdint>

#include "engine/render/projection.h"
#include "hwy/aligned_allocator.h"

namespace litags {

struct TileJob {
  int x0 = 0, y0 = 0;                     // top-left pixel of the tile
  int width = 0, height = 0;              // image, px
  int channels = 0;                       // 3 or 11
  size_t count = 0;                       // Gaussians in the list, front to back
  const uint32_t* gaussians = nullptr;    // [count]
  const float* records = nullptr;         // [N][RecordStride(channels)]
  const EllipseBounds* bounds = nullptr;  // [N]
  const float* background = nullptr;      // [channels]
  // [count], bit b: block b of the tile is reached. Written by the forward pass up to the point
  // where the tile is opaque (zero from there on), read by the backward pass.
  uint64_t* block_masks = nullptr;
};

// Writes the tile's pixels of image [C, H, W] and alpha [H, W]. Returns the number of alpha
// evaluations (lanes).
int64_t RasterizeTile(const TileJob& job, float* image, float* alpha);

// Grows as needed; one per thread.
struct TileScratch {
  hwy::AlignedFreeUniquePtr<float[]> data;
  size_t size = 0;
  float* Reserve(size_t floats);
};

// Writes GradStride(channels) sums to grads[slots[k] * stride] for every k < count (zero where
// nothing contributed). v_alpha may be null.
void RasterizeTileVjp(const TileJob& job, const uint32_t* slots, const float* v_image,
                      const float* v_alpha, float* grads, TileScratch* scratch);

}  // namespace litags

#endif  // LITAGS_ENGINE_RENDER_RASTERIZE_H_
