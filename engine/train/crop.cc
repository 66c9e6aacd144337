#include "engine/train/crop.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>
#include <vector>

#include "engine/core/parallel.h"
#include "engine/core/rng.h"

namespace litags {
namespace {

constexpr uint64_t kCropStream = 0x4352;  // random numbers of crops
constexpr int kTaskRows = 32;

// Cells along a side of `size` px.
int CellsAlong(int size, int64_t pixels) {
  if (pixels == 0) return 1;
  return std::max(1, static_cast<int>(std::lround(size / std::sqrt(double(pixels)))));
}

// Where cell `k` of `cells` begins; `shift` in cells.
int CellBegin(int size, int cells, int k, double shift) {
  if (k == 0 || k == cells) return k == 0 ? 0 : size;
  return static_cast<int>(std::lround(size * (k + shift) / cells));
}

template <class Image>
void CropImage(const Image& from, const PixelRect& crop, int channels, int threads, Image* to) {
  to->width = from.empty() ? 0 : crop.width;
  to->height = from.empty() ? 0 : crop.height;
  to->data.resize(size_t(to->width) * to->height * channels);
  const size_t row = size_t(to->width) * channels;
  ParallelFor(threads, (to->height + kTaskRows - 1) / kTaskRows, [&](size_t task, int) {
    const int first = static_cast<int>(task) * kTaskRows;
    for (int y = first; y < std::min(to->height, first + kTaskRows); ++y) {
      const size_t begin = (size_t(crop.y + y) * from.width + crop.x) * channels;
      std::copy_n(from.data.data() + begin, row, to->data.data() + y * row);
    }
  });
}

}  // namespace

size_t Shuffled(uint64_t seed, uint64_t stream, size_t n, size_t index) {
  const CounterRng rng(seed, stream);
  std::vector<uint32_t> order(n);
  std::iota(order.begin(), order.end(), 0);
  for (size_t i = n - 1; i > 0; --i) std::swap(order[i], order[rng.Below(i, i + 1)]);
  return order[index];
}

CropGrid::CropGrid(int photo_width, int photo_height, int64_t pixels)
    : width(photo_width),
      height(photo_height),
      columns(CellsAlong(photo_width, pixels)),
      rows(CellsAlong(photo_height, pixels)) {}

PixelRect DrawCrop(const CropGrid& grid, uint64_t seed, size_t photo, uint64_t visit) {
  const uint64_t cells = grid.cells();
  if (cells == 1) return {0, 0, grid.width, grid.height};
  const auto stream = [&](uint64_t use, uint64_t number) {
    return kCropStream + (use << 16) + (uint64_t{photo} << 20) + (number << 40);
  };
  const int cell = static_cast<int>(
      Shuffled(seed, stream(0, visit / cells), cells, static_cast<size_t>(visit % cells)));
  const CounterRng rng(seed, stream(1, visit));
  const double shift_x = rng.Uniform(0) - 0.5, shift_y = rng.Uniform(1) - 0.5;
  const int column = cell % grid.columns, row = cell / grid.columns;
  PixelRect crop;
  crop.x = CellBegin(grid.width, grid.columns, column, shift_x);
  crop.y = CellBegin(grid.height, grid.rows, row, shift_y);
  crop.width = CellBegin(grid.width, grid.columns, column + 1, shift_x) - crop.x;
  crop.height = CellBegin(grid.height, grid.rows, row + 1, shift_y) - crop.y;
  return crop;
}

void CropView(const TrainView& view, const PixelRect& crop, int threads, TrainView* out) {
  out->view = view.view;
  out->lamp = view.lamp;
  CropImage(view.photo, crop, 3, threads, &out->photo);
  CropImage(view.target, crop, 3, threads, &out->target);
  CropImage(view.structure, crop, 1, threads, &out->structure);
  CropImage(view.information, crop, 1, threads, &out->information);
  CropImage(view.mask, crop, 1, threads, &out->mask);
  if (!view.depth.has_value()) {
    out->depth.reset();
    return;
  }
  if (!out->depth.has_value()) out->depth.emplace();
  ResizeDepth(*view.depth, view.photo.width, view.photo.height, crop, threads, &*out->depth);
}

}  // namespace litags
