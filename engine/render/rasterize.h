// Compositing one 16x16 tile, forward and backward. The tile is cut into blocks of one SIMD vector
// of pixels, 4 x (lanes / 4). Each block walks the Gaussians that reach it with its channels in
// registers; which Gaussians those are is a bit mask per block and chunk of 64 list entries.
#ifndef LITAGS_ENGINE_RENDER_RASTERIZE_H_
#define LITAGS_ENGINE_RENDER_RASTERIZE_H_

#include <cstddef>
#include <cstdint>
#include <vector>

#include "engine/core/aligned.h"

namespace litags {

constexpr int kChunk = 64;          // list entries that share one mask word per block
constexpr int kMaxTileBlocks = 64;  // blocks of 4 lanes; wider vectors have fewer

struct TileJob {
  int x0 = 0, y0 = 0;                   // top-left pixel of the tile
  int width = 0, height = 0;            // image, px
  int channels = 0;                     // as RenderSettings::num_channels
  uint32_t kept_channels = 0;           // bit c: the image has channel c
  size_t count = 0;                     // Gaussians in the list, front to back
  const uint32_t* gaussians = nullptr;  // [count]
  const float* records = nullptr;       // [N][RecordStride(channels)]
  const float* background = nullptr;    // [channels]
  // [ceil(count / kChunk)][kMaxTileBlocks]: bit k of word [j][b] is set if Gaussian j * kChunk + k
  // of the list reaches block b before the block is opaque. Written by the forward pass, read by
  // the backward pass.
  uint64_t* reach = nullptr;
};

// LITA-GS Eq. 8: the sum over Gaussians, all channels together.
// Writes the tile's pixels of image [kept channels, H, W] and alpha [H, W]. Returns the evaluations
// of alpha, pixels (lanes counted one by one).
int64_t RasterizeTile(const TileJob& job, float* image, float* alpha);

// Buffers of RasterizeTileVjp, kept to save allocations; one per thread.
struct TileScratch {
  AlignedFloats records, grads, evaluations;
  std::vector<uint32_t> entries;
};

struct TileGradients {
  const float* v_image = nullptr;   // [C, H, W]
  const float* v_alpha = nullptr;   // [H, W], may be null
  const uint32_t* slots = nullptr;  // [count]
  float* pairs = nullptr;           // [..][GradStride(channels)]
  uint32_t detached_channels = 0;   // as in RenderSettings
};

// Writes GradStride(channels) sums to pairs[slots[k]] for every k < count (zero where nothing
// contributed).
void RasterizeTileVjp(const TileJob& job, const TileGradients& gradients, TileScratch* scratch);

}  // namespace litags

#endif  // LITAGS_ENGINE_RENDER_RASTERIZE_H_
