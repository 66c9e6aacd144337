#include "engine/render/binning.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

#include "engine/core/aligned.h"
#include "engine/core/check.h"
#include "engine/core/parallel.h"
#include "engine/render/constants.h"

namespace litags {
namespace {

// Ranges of Gaussians that are counted and filled independently, of about as many visible ones
// each: neighbours in space are neighbours in memory, so a crop sees few ranges of memory. Fixed,
// so that the work and its result are the same for any number of threads.
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

using Pair = BinScratch::Pair;

// Writes a pair for every tile of the row `ty` that the span and the part have; returns where the
// next one goes. Up to two past that are overwritten: most spans have one or two tiles, and which
// of them would be hard to predict for a branch.
inline Pair* AddRow(uint32_t gaussian, const TileRect& part, int ty, int first, int last,
                    Pair* to) {
  if (ty < part.y || ty >= part.y + part.height) return to;
  first = std::max(first - part.x, 0);
  last = std::min(last - part.x, part.width - 1);
  const uint32_t row = (ty - part.y) * part.width;
  *to = {gaussian, row + first};
  to += first <= last;
  *to = {gaussian, row + first + 1};
  to += first + 1 <= last;
  for (int tx = first + 2; tx <= last; ++tx) *to++ = {gaussian, row + tx};
  return to;
}

// The same for all tiles that Gaussian i reaches, row by row.
inline Pair* AddTiles(const ProjectedSplats& splats, size_t i, const TileRect& part, Pair* to) {
  const auto gaussian = static_cast<uint32_t>(i);
  const ProjectedSplats::Box& box = splats.boxes[i];
  const ProjectedSplats::Spans& spans = splats.spans[i];
  constexpr unsigned kTile = kTileSize;  // boxes that are not empty have no negative numbers
  int ty = box.y0 / kTile;
  for (int row = 0; row < ProjectedSplats::kSpanRows; ++row, ++ty) {
    to = AddRow(gaussian, part, ty, spans.first[row], spans.last[row], to);
  }
  ty = std::max(ty, part.y);
  for (const int end = std::min<int>(box.y1 / kTile + 1, part.y + part.height); ty < end; ++ty) {
    const float* record = splats.records.data() + i * RecordStride(splats.channels);
    const TileSpan span = SpanOfRow(box, record, ty);
    to = AddRow(gaussian, part, ty, span.first, span.last, to);
  }
  return to;
}

// The first Gaussian of each chunk, and at the end how many there are. Chunks are whole blocks.
std::array<size_t, kChunks + 1> ChunkBegins(const ProjectedSplats& splats) {
  const std::vector<uint8_t>& visible = splats.visible;
  // A block costs something even where nothing of it is visible.
  const size_t all = std::accumulate(visible.begin(), visible.end(), visible.size());
  const size_t n = splats.boxes.size();
  std::array<size_t, kChunks + 1> begins;
  begins.fill(n);
  begins[0] = 0;
  size_t chunk = 1;
  for (size_t block = 0, before = 0; block < visible.size(); ++block) {
    before += 1 + visible[block];
    while (chunk < kChunks && before * kChunks >= all * chunk) {
      begins[chunk++] = std::min(n, (block + 1) * kSplatBlock);
    }
  }
  return begins;
}

// Which tiles of the part the Gaussians [begin, end) reach. Adds to counts [tiles]; slot_begin
// becomes each one's first pair, counted from `begin`.
void FindTiles(const ProjectedSplats& splats, size_t begin, size_t end, const TileRect& part,
               BinScratch::ChunkPairs* chunk, uint32_t* counts, uint32_t* slot_begin) {
  std::vector<Pair> pairs = std::move(chunk->pairs);  // chunks share cache lines
  const size_t most = part.size() + 2;                // that one Gaussian writes, AddRow's two too
  size_t count = 0, visible = 0;
  for (size_t i = begin; i < end; ++i) {
    slot_begin[i] = static_cast<uint32_t>(count);
    if (splats.visible[i / kSplatBlock] == 0 || splats.boxes[i].empty()) continue;
    if (pairs.size() < count + most) pairs.resize(2 * (count + most));
    Pair* const to = pairs.data() + count;
    const auto added = static_cast<size_t>(AddTiles(splats, i, part, to) - to);
    count += added;
    visible += added > 0;
  }
  for (size_t k = 0; k < count; ++k) ++counts[pairs[k].tile];
  *chunk = {std::move(pairs), count, visible};
}

// Turns the counts per chunk and tile into offsets into the tiles' lists, and fills tile_begin.
// Returns the first slot of each chunk; the last one is the number of pairs.
std::array<uint32_t, kChunks + 1> CountsToOffsets(TileLists* lists, BinScratch* scratch) {
  size_t pairs = 0;
  for (const BinScratch::ChunkPairs& chunk : scratch->chunks) pairs += chunk.count;
  LITAGS_CHECK(pairs <= std::numeric_limits<uint32_t>::max());  // slots have 32 bits

  const size_t tiles = lists->part.size();
  lists->tile_begin.resize(tiles + 1);
  uint32_t total = 0;
  for (size_t tile = 0; tile < tiles; ++tile) {
    lists->tile_begin[tile] = total;
    for (size_t chunk = 0; chunk < kChunks; ++chunk) {
      total += std::exchange(scratch->offsets[chunk * tiles + tile], total);
    }
  }
  lists->tile_begin[tiles] = total;
  std::array<uint32_t, kChunks + 1> first_slot = {};
  for (size_t chunk = 0; chunk < kChunks; ++chunk) {
    first_slot[chunk + 1] = first_slot[chunk] + static_cast<uint32_t>(scratch->chunks[chunk].count);
  }
  return first_slot;
}

// Sorts every tile by depth, equal depths by slot and so by Gaussian.
void SortTiles(int threads, TileLists* lists, BinScratch* scratch) {
  const size_t tiles = lists->tile_begin.size() - 1;
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

}  // namespace

TileRect AllTiles(int width, int height) {
  return {0, 0, (width + kTileSize - 1) / kTileSize, (height + kTileSize - 1) / kTileSize};
}

std::vector<TileRect> PartsOf(const ProjectedSplats& splats, int width, int height,
                              size_t max_pairs) {
  const TileRect all = AllTiles(width, height);
  // What every row of tiles has more than the one above it.
  std::vector<int64_t> more(all.height + 1);
  for (size_t i = 0; i < splats.boxes.size(); ++i) {
    const ProjectedSplats::Box& box = splats.boxes[i];
    if (box.empty()) continue;
    const int columns = box.x1 / kTileSize - box.x0 / kTileSize + 1;
    more[box.y0 / kTileSize] += columns;
    more[box.y1 / kTileSize + 1] -= columns;
  }
  std::vector<TileRect> parts;
  size_t row_pairs = 0, part_pairs = 0;
  for (int y = 0; y < all.height; ++y) {
    row_pairs += more[y];
    part_pairs += row_pairs;
    if (!parts.empty() && part_pairs <= max_pairs) {
      ++parts.back().height;
      continue;
    }
    part_pairs = row_pairs;
    const size_t pieces = std::max<size_t>((row_pairs + max_pairs - 1) / max_pairs, 1);
    const int columns = static_cast<int>(std::max<size_t>(all.width / pieces, 1));
    for (int x = 0; x < all.width; x += columns) {
      parts.push_back({x, y, std::min(columns, all.width - x), 1});
    }
  }
  return parts;
}

void Bin(const ProjectedSplats& splats, const TileRect& part, int threads, TileLists* lists,
         BinScratch* scratch) {
  lists->part = part;
  const size_t tiles = part.size();
  const size_t n = splats.boxes.size();
  const std::array<size_t, kChunks + 1> chunk_begin = ChunkBegins(splats);

  scratch->chunks.resize(kChunks);
  scratch->offsets.assign(kChunks * tiles, 0);
  lists->slot_begin.resize(n + 1);
  ParallelFor(threads, kChunks, [&](size_t chunk, int) {
    FindTiles(splats, chunk_begin[chunk], chunk_begin[chunk + 1], part, &scratch->chunks[chunk],
              scratch->offsets.data() + chunk * tiles, lists->slot_begin.data());
  });
  const std::array<uint32_t, kChunks + 1> first_slot = CountsToOffsets(lists, scratch);
  const uint32_t pairs = first_slot[kChunks];
  lists->slot_begin[n] = pairs;
  lists->num_visible = 0;
  for (const BinScratch::ChunkPairs& chunk : scratch->chunks) lists->num_visible += chunk.visible;

  // Depths are positive, so their bits sort like numbers.
  ResizeScratch(pairs, &scratch->keys);
  for (auto* v : {&scratch->gaussian_of_slot, &lists->gaussians, &lists->slots})
    ResizeScratch(pairs, v);
  ParallelFor(threads, kChunks, [&](size_t chunk, int) {
    uint32_t* offset = scratch->offsets.data() + chunk * tiles;
    const Pair* pair = scratch->chunks[chunk].pairs.data();
    for (size_t i = chunk_begin[chunk]; i < chunk_begin[chunk + 1]; ++i)
      lists->slot_begin[i] += first_slot[chunk];
    for (uint32_t slot = first_slot[chunk]; slot < first_slot[chunk + 1]; ++slot, ++pair) {
      const uint64_t depth = std::bit_cast<uint32_t>(splats.depths[pair->gaussian]);
      scratch->keys[offset[pair->tile]++] = depth << 32 | slot;
      scratch->gaussian_of_slot[slot] = pair->gaussian;
    }
  });
  SortTiles(threads, lists, scratch);
}

}  // namespace litags
