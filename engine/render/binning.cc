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

// Tile columns that a Gaussian reaches in the row `ty` of tiles; empty if first > last. As
// ColumnsOfRows, for the few Gaussians with more rows than ProjectedSplats::spans has.
struct TileSpan {
  int first, last;
};
TileSpan SpanOfRow(const ProjectedSplats::Box& box, const float* record, int ty) {
  const float my = record[kRecordY], half_height = record[kRecordHalfHeight];
  // Pixel centres of the row, relative to the mean, limited to the ellipse.
  const float lo = std::max(ty * kTileSize + 0.5f - my, -half_height);
  const float hi = std::min(ty * kTileSize + kTileSize - 0.5f - my, half_height);
  if (lo > hi) return {0, -1};
  const auto at = [&](float dy) { return std::min(std::max(dy, lo), hi); };
  const auto half_chord = [&](float dy) {
    const float inside = half_height * half_height - dy * dy;
    return record[kRecordAspect] * std::sqrt(std::max(0.0f, inside)) + 0.02f;
  };
  const float dy_right = at(record[kRecordDyRight]), dy_left = at(-record[kRecordDyRight]);
  const float center = record[kRecordX] - 0.5f;
  const float right = center + record[kRecordShear] * dy_right + half_chord(dy_right);
  const float left = center + record[kRecordShear] * dy_left - half_chord(dy_left);
  // Numbers that are not finite give all of the box.
  const int first = left > box.x0 ? static_cast<int>(std::ceil(std::min(left, 40000.0f))) : box.x0;
  const int last = right < box.x1 ? static_cast<int>(std::floor(std::max(right, -1.0f))) : box.x1;
  if (first > last) return {0, -1};
  return {first / kTileSize, last / kTileSize};
}

// Calls visit(tile) for every tile that Gaussian i reaches, row by row.
template <class Visit>
inline void ForEachTile(const ProjectedSplats& splats, size_t i, int tiles_x, Visit&& visit) {
  const ProjectedSplats::Box& box = splats.boxes[i];
  const int ty0 = box.y0 / kTileSize, ty1 = box.y1 / kTileSize;
  const auto visit_row = [&](int ty, int first, int last) {
    for (int tx = first; tx <= last; ++tx) visit(ty * tiles_x + tx);
  };
  const ProjectedSplats::Spans& spans = splats.spans[i];
  const int known = std::min(ty1, ty0 + ProjectedSplats::kSpanRows - 1);
  for (int ty = ty0; ty <= known; ++ty) visit_row(ty, spans.first[ty - ty0], spans.last[ty - ty0]);
  const float* record = splats.records.data() + i * RecordStride(splats.channels);
  for (int ty = known + 1; ty <= ty1; ++ty) {
    const TileSpan span = SpanOfRow(box, record, ty);
    visit_row(ty, span.first, span.last);
  }
}

}  // namespace

void Bin(const ProjectedSplats& splats, int width, int height, int threads, TileLists* lists,
         BinScratch* scratch) {
  lists->tiles_x = (width + kTileSize - 1) / kTileSize;
  lists->tiles_y = (height + kTileSize - 1) / kTileSize;
  const size_t tiles = size_t(lists->tiles_x) * lists->tiles_y;
  const size_t n = splats.boxes.size();
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
        ForEachTile(splats, i, lists->tiles_x, [&](uint32_t tile) {
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

  // Distribute, then sort every tile by depth, equal depths by slot and so by Gaussian. Depths are
  // positive, so their bits sort like numbers.
  scratch->keys.resize(total);
  for (auto* v : {&scratch->gaussian_of_slot, &lists->gaussians, &lists->slots}) v->resize(total);
  ParallelFor(threads, kChunks, [&](size_t chunk, int) {
    uint32_t* offset = scratch->offsets.data() + chunk * tiles;
    const uint32_t* tile = scratch->chunk_tiles[chunk].data();
    for (size_t i = chunk_begin(chunk); i < chunk_begin(chunk + 1); ++i) {
      for (uint32_t slot = lists->slot_begin[i]; slot < lists->slot_begin[i + 1]; ++slot) {
        const uint64_t depth = std::bit_cast<uint32_t>(splats.depths[i]);
        scratch->keys[offset[*tile++]++] = depth << 32 | slot;
        scratch->gaussian_of_slot[slot] = static_cast<uint32_t>(i);
      }
    }
  });
  scratch->sorters.resize(threads);
  ParallelFor(threads, (tiles + kTilesPerTask - 1) / kTilesPerTask, [&](size_t task, int thread) {
    const size_t begin = task * kTilesPerTask, end = std::min(tiles, begin + kTilesPerTask);
    for (size_t tile = begin; tile < end; ++tile) {
      scratch->sorters[thread](scratch->keys.data() + lists->tile_begin[tile],
                               lists->tile_begin[tile + 1] - lists->tile_begin[tile],
                               hwy::SortAscending());
    }
    for (uint32_t k = lists->tile_begin[begin]; k < lists->tile_begin[end]; ++k) {
      lists->slots[k] = static_cast<uint32_t>(scratch->keys[k]);
      lists->gaussians[k] = scratch->gaussian_of_slot[lists->slots[k]];
    }
  });
}

}  // namespace litags
