// Which Gaussians touch which 16x16 tile, front to back.
#ifndef LITAGS_ENGINE_RENDER_BINNING_H_
#define LITAGS_ENGINE_RENDER_BINNING_H_

#include <cstddef>
#include <cstdint>
#include <vector>

#include "engine/render/projection.h"
#include "hwy/contrib/sort/vqsort.h"

namespace litags {

// Tiles of an image; their numbers are in tiles.
struct TileRect {
  int x = 0, y = 0, width = 0, height = 0;

  size_t size() const { return size_t(width) * height; }
};

TileRect AllTiles(int width, int height);  // of an image, px

// The image's tiles in parts of at most about `max_pairs` (Gaussian, tile) pairs each, by the
// Gaussians' boxes, and of a tile at least.
std::vector<TileRect> PartsOf(const ProjectedSplats& splats, int width, int height,
                              size_t max_pairs);

// Lists of a part's tiles, one after the other; inside a tile Gaussians are ordered by depth, equal
// depths by index.
struct TileLists {
  TileRect part;
  std::vector<uint32_t> tile_begin;  // [tiles + 1], into the two arrays below
  std::vector<uint32_t> gaussians;   // index of the Gaussian
  std::vector<uint32_t> slots;       // where this pair's gradients go: pairs numbered by Gaussian
  std::vector<uint32_t> slot_begin;  // [N + 1], first slot of each Gaussian
  size_t num_visible = 0;

  size_t num_pairs() const { return gaussians.size(); }
};

// Scratch of Bin, kept to save allocations.
struct BinScratch {
  struct Pair {
    uint32_t gaussian, tile;
  };
  // What a chunk of Gaussians reaches, in memory order; the first `count` are in use.
  struct ChunkPairs {
    std::vector<Pair> pairs;
    size_t count = 0, visible = 0;
  };
  std::vector<ChunkPairs> chunks;
  std::vector<uint32_t> offsets;           // [chunks][tiles]
  std::vector<uint32_t> gaussian_of_slot;  // [pairs]
  std::vector<uint64_t> keys;              // [pairs], by tile: depth bits, slot
  std::vector<hwy::Sorter> sorters;        // per thread; costly to make
};

// Fills `lists` for a part of an image. A Gaussian is in a tile exactly when its
// alpha >= 1/255 ellipse reaches the tile's pixel centres (to rounding): the bounding box alone
// would list half as many again (Speedy-Splat's AccuTile makes the same observation).
void Bin(const ProjectedSplats& splats, const TileRect& part, int threads, TileLists* lists,
         BinScratch* scratch);

}  // namespace litags

#endif  // LITAGS_ENGINE_RENDER_BINNING_H_
