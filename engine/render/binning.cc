#include "engine/render/binning.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <utility>

#include "engine/core/parallel.h"
#include "engine/render/constants.h"

namespace litags {
namespace {

// Ranges of Gaussians that are counted and filled independently. Fixed, so that the work and its
// result are the same for any number of threads.
constexpr size_t kChunks = 16;
constexpr size_t kTilesPerTask = 16;

// Calls visit(tile) for every tile the Gaussian reaches, row by row.
template <class Visit>
inline void ForEachTile(const ProjectedSplats::Box& box, const float* record, int tiles_x,
                        Visit&& visit) {
  const int tx0 = box.x0 / kTileSize, tx1 = box.x1 / kTileSize;
  const int ty0 = box.y0 / kTileSize, ty1 = box.y1 / kTileSize;
  if (tx0 == tx1 || ty0 == ty1) {  // a single row or column of tiles is all reached
    for (int ty = ty0; ty <= ty1; ++ty) {
      for (int tx = tx0; tx <= tx1; ++tx) visit(ty * tiles_x + tx);
    }
    return;
  }
  const float mx = record[kRecordX], my = record[kRecordY];
  const float hh = record[kRecordHalfHeight], hh2 = hh * hh;
  const float shear = record[kRecordShear], rightmost = record[kRecordDyRight];
  const auto half_chord = [&](float dy) {
    return record[kRecordAspect] * std::sqrt(std::max(0.0f, hh2 - dy * dy));
  };
  for (int ty = ty0; ty <= ty1; ++ty) {
    // Pixel centres of this tile row, relative to the mean, limited to the ellipse.
    const float lo = std::max(ty * kTileSize + 0.5f - my, -hh);
    const float hi = std::min(ty * kTileSize + kTileSize - 0.5f - my, hh);
    if (lo > hi) continue;
    const float dy_right = std::min(std::max(rightmost, lo), hi);
    const float dy_left = std::min(std::max(-rightmost, lo), hi);
    // The margin covers rounding; it costs nothing measurable.
    const float right = mx + shear * dy_right + half_chord(dy_right) + 0.02f;
    const float left = mx + shear * dy_left - half_chord(dy_left) - 0.02f;
    const int first_px =
        std::max<int>(box.x0, static_cast<int>(std::ceil(std::max(left - 0.5f, -1.0f))));
    const int last_px =
        std::min<int>(box.x1, static_cast<int>(std::floor(std::min(right - 0.5f, 40000.0f))));
    if (first_px > last_px) continue;
    for (int tx = first_px / kTileSize; tx <= last_px / kTileSize; ++tx) visit(ty * tiles_x + tx);
  }
}

// Puts one tile's pairs in order of depth; equal depths keep the order of Gaussians. Depths are
// positive, so their bits sort like numbers.
void SortTile(const ProjectedSplats& splats, const BinScratch& scratch, uint32_t begin,
              uint32_t end, BinScratch::Sorting* sorting, TileLists* lists) {
  std::vector<uint64_t>& keys = sorting->keys;
  keys.resize(end - begin);
  for (uint32_t k = begin; k < end; ++k) {
    const float depth = splats.depths[scratch.gaussians[k]];
    keys[k - begin] = uint64_t{std::bit_cast<uint32_t>(depth)} << 32 | k;
  }
  sorting->sort(keys.data(), keys.size(), hwy::SortAscending());
  for (uint32_t k = begin; k < end; ++k) {
    const auto from = static_cast<uint32_t>(keys[k - begin]);
    lists->gaussians[k] = scratch.gaussians[from];
    lists->slots[k] = scratch.slots[from];
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
  const auto chunk_begin = [&](size_t chunk) { return n * chunk / kChunks; };

  // Which tiles each Gaussian reaches, in memory order; counts per Gaussian and per (chunk, tile).
  scratch->chunk_tiles.resize(kChunks);
  scratch->offsets.assign(kChunks * tiles, 0);
  lists->slot_begin.resize(n + 1);
  lists->slot_begin[0] = 0;
  ParallelFor(threads, kChunks, [&](size_t chunk, int) {
    uint32_t* count = scratch->offsets.data() + chunk * tiles;
    std::vector<uint32_t>& reached = scratch->chunk_tiles[chunk];
    reached.clear();
    for (size_t i = chunk_begin(chunk); i < chunk_begin(chunk + 1); ++i) {
      const size_t before = reached.size();
      if (!splats.boxes[i].empty()) {
        ForEachTile(splats.boxes[i], splats.records.data() + i * stride, lists->tiles_x,
                    [&](uint32_t tile) {
                      ++count[tile];
                      reached.push_back(tile);
                    });
      }
      lists->slot_begin[i + 1] = static_cast<uint32_t>(reached.size() - before);
    }
  });

  // Counts to offsets.
  lists->num_visible = 0;
  for (size_t i = 0; i < n; ++i) {
    lists->num_visible += lists->slot_begin[i + 1] > 0;
    lists->slot_begin[i + 1] += lists->slot_begin[i];
  }
  lists->tile_begin.resize(tiles + 1);
  uint32_t total = 0;
  for (size_t tile = 0; tile < tiles; ++tile) {
    lists->tile_begin[tile] = total;
    for (size_t chunk = 0; chunk < kChunks; ++chunk) {
      total += std::exchange(scratch->offsets[chunk * tiles + tile], total);
    }
  }
  lists->tile_begin[tiles] = total;

  // Distribute, then sort every tile.
  for (auto* v : {&scratch->gaussians, &scratch->slots, &lists->gaussians, &lists->slots})
    v->resize(total);
  ParallelFor(threads, kChunks, [&](size_t chunk, int) {
    uint32_t* offset = scratch->offsets.data() + chunk * tiles;
    const uint32_t* tile = scratch->chunk_tiles[chunk].data();
    for (size_t i = chunk_begin(chunk); i < chunk_begin(chunk + 1); ++i) {
      for (uint32_t slot = lists->slot_begin[i]; slot < lists->slot_begin[i + 1]; ++slot) {
        const uint32_t at = offset[*tile++]++;
        scratch->gaussians[at] = static_cast<uint32_t>(i);
        scratch->slots[at] = slot;
      }
    }
  });
  scratch->sorting.resize(threads);
  ParallelFor(threads, (tiles + kTilesPerTask - 1) / kTilesPerTask, [&](size_t task, int thread) {
    const size_t end = std::min(tiles, (task + 1) * kTilesPerTask);
    for (size_t tile = task * kTilesPerTask; tile < end; ++tile) {
      SortTile(splats, *scratch, lists->tile_begin[tile], lists->tile_begin[tile + 1],
               &scratch->sorting[thread], lists);
    }
  });
}

}  // namespace litags
