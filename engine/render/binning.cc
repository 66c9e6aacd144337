#include "engine/render/binning.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "engine/core/parallel.h"
#include "engine/render/constants.h"

namespace litags {
namespace {

// Runs of sorted Gaussians that are counted and filled independently. Fixed, so that the work and
// its result are the same for any number of threads.
constexpr size_t kChunks = 8;

// Stable radix sort by the upper 32 bits (11 bits a pass).
void RadixSortByDepth(std::vector<uint64_t>* keys, std::vector<uint64_t>* tmp) {
  constexpr int kBits = 11, kBuckets = 1 << kBits;
  tmp->resize(keys->size());
  for (int shift : {32, 32 + kBits, 32 + 2 * kBits}) {
    uint32_t count[kBuckets + 1] = {};
    for (uint64_t key : *keys) ++count[((key >> shift) & (kBuckets - 1)) + 1];
    if (count[((*keys)[0] >> shift & (kBuckets - 1)) + 1] == keys->size()) continue;
    for (int i = 0; i < kBuckets; ++i) count[i + 1] += count[i];
    for (uint64_t key : *keys) (*tmp)[count[(key >> shift) & (kBuckets - 1)]++] = key;
    keys->swap(*tmp);
  }
}

// Calls visit(tile) for every tile the Gaussian reaches, row by row.
template <class Visit>
inline void ForEachTile(const ProjectedSplats::Box& box, const float* record,
                        const EllipseBounds& bounds, int tiles_x, Visit&& visit) {
  const int tx0 = box.x0 / kTileSize, tx1 = box.x1 / kTileSize;
  const int ty0 = box.y0 / kTileSize, ty1 = box.y1 / kTileSize;
  if (tx0 == tx1 || ty0 == ty1) {  // a single row or column of tiles is all reached
    for (int ty = ty0; ty <= ty1; ++ty) {
      for (int tx = tx0; tx <= tx1; ++tx) visit(ty * tiles_x + tx);
    }
    return;
  }
  const float mx = record[kRecordX], my = record[kRecordY];
  const float hh = bounds.half_height, hh2 = hh * hh;
  const auto half_chord = [&](float dy) {
    return bounds.aspect * std::sqrt(std::max(0.0f, hh2 - dy * dy));
  };
  for (int ty = ty0; ty <= ty1; ++ty) {
    // Pixel centres of this tile row, relative to the mean, limited to the ellipse.
    const float lo = std::max(ty * kTileSize + 0.5f - my, -hh);
    const float hi = std::min(ty * kTileSize + kTileSize - 0.5f - my, hh);
    if (lo > hi) continue;
    const float dy_right = std::min(std::max(bounds.dy_right, lo), hi);
    const float dy_left = std::min(std::max(-bounds.dy_right, lo), hi);
    // The margin covers rounding; it costs nothing measurable.
    const float right = mx + bounds.shear * dy_right + half_chord(dy_right) + 0.02f;
    const float left = mx + bounds.shear * dy_left - half_chord(dy_left) - 0.02f;
    const int first_px =
        std::max<int>(box.x0, static_cast<int>(std::ceil(std::max(left - 0.5f, -1.0f))));
    const int last_px =
        std::min<int>(box.x1, static_cast<int>(std::floor(std::min(right - 0.5f, 40000.0f))));
    if (first_px > last_px) continue;
    for (int tx = first_px / kTileSize; tx <= last_px / kTileSize; ++tx) visit(ty * tiles_x + tx);
  }
}

}  // namespace

void Bin(const ProjectedSplats& splats, int width, int height, int threads, TileLists* lists,
         BinScratch* scratch) {
  lists->tiles_x = (width + kTileSize - 1) / kTileSize;
  lists->tiles_y = (height + kTileSize - 1) / kTileSize;
  const size_t tiles = size_t(lists->tiles_x) * lists->tiles_y;
  const size_t n = splats.boxes.size();
  const int stride = RecordStride(splats.channels);

  // Visible Gaussians by depth. Depths are positive, so their bits sort like numbers.
  scratch->keys.clear();
  for (size_t i = 0; i < n; ++i) {
    if (splats.boxes[i].empty()) continue;
    scratch->keys.push_back(uint64_t{std::bit_cast<uint32_t>(splats.depths[i])} << 32 | i);
  }
  const size_t visible = scratch->keys.size();
  lists->num_visible = visible;
  if (visible > 0) RadixSortByDepth(&scratch->keys, &scratch->keys_tmp);

  const auto for_chunk = [&](size_t chunk, auto&& visit) {
    const size_t begin = visible * chunk / kChunks, end = visible * (chunk + 1) / kChunks;
    for (size_t k = begin; k < end; ++k) {
      const uint32_t i = static_cast<uint32_t>(scratch->keys[k]);
      ForEachTile(splats.boxes[i], splats.records.data() + size_t{i} * stride, splats.bounds[i],
                  lists->tiles_x, [&](uint32_t tile) { visit(i, tile); });
    }
  };

  // Count pairs per tile (per chunk) and per Gaussian.
  scratch->offsets.assign(kChunks * tiles, 0);
  lists->slot_begin.assign(n + 1, 0);
  ParallelFor(threads, kChunks, [&](size_t chunk, int) {
    uint32_t* count = scratch->offsets.data() + chunk * tiles;
    for_chunk(chunk, [&](uint32_t i, uint32_t tile) {
      ++count[tile];
      ++lists->slot_begin[i + 1];
    });
  });
  lists->tile_begin.resize(tiles + 1);
  uint32_t total = 0;
  for (size_t tile = 0; tile < tiles; ++tile) {
    lists->tile_begin[tile] = total;
    for (size_t chunk = 0; chunk < kChunks; ++chunk) {
      uint32_t& offset = scratch->offsets[chunk * tiles + tile];
      const uint32_t count = offset;
      offset = total;
      total += count;
    }
  }
  lists->tile_begin[tiles] = total;
  for (size_t i = 0; i < n; ++i) lists->slot_begin[i + 1] += lists->slot_begin[i];

  // Fill; chunk by chunk keeps the depth order inside every tile.
  lists->gaussians.resize(total);
  lists->slots.resize(total);
  ParallelFor(threads, kChunks, [&](size_t chunk, int) {
    uint32_t* offset = scratch->offsets.data() + chunk * tiles;
    uint32_t last = UINT32_MAX, slot = 0;
    for_chunk(chunk, [&](uint32_t i, uint32_t tile) {
      slot = i == last ? slot + 1 : lists->slot_begin[i];
      last = i;
      const uint32_t at = offset[tile]++;
      lists->gaussians[at] = i;
      lists->slots[at] = slot;
    });
  });
}

}  // namespace litags
