// Iterations that compare a part of a photo: what an iteration costs, and what it learns, then does
// not depend on how large photos are.
#ifndef LITAGS_ENGINE_TRAIN_CROP_H_
#define LITAGS_ENGINE_TRAIN_CROP_H_

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "engine/core/image.h"
#include "engine/train/train_view.h"

namespace litags {

// Element `index` < n of a random order of 0 .. n - 1 that (seed, stream) decide.
size_t Shuffled(uint64_t seed, uint64_t stream, size_t n, size_t index);

// How a photo is cut: columns times rows of about square cells of about `pixels`; one cell for
// photos of less than 1.5 times that along both sides, or if pixels is 0.
struct CropGrid {
  int width = 0, height = 0;  // of the photo, px
  int columns = 1, rows = 1;

  CropGrid(int photo_width, int photo_height, int64_t pixels);
  int cells() const { return columns * rows; }
  // Of the mean cell, px.
  double LargerSide() const { return std::max(double(width) / columns, double(height) / rows); }
  // What a loss that is a mean over a crop is to be multiplied by, so that every pixel has the same
  // part in the sum over many crops: its pixels over those of the mean cell.
  double WeightOf(const PixelRect& crop) const {
    return double(crop.width) * crop.height * cells() / (double(width) * height);
  }
};

// The crop of a photo's visit number `visit`: every cell once, in a random order, before any again.
// The lines between cells are shifted at random by up to half a cell, so that none is a border in
// every visit; every pixel is as likely to be seen as another. A pure function of its arguments.
PixelRect DrawCrop(const CropGrid& grid, uint64_t seed, size_t photo, uint64_t visit);

// What is compared in the crop: every image of `view` cut to it. The camera stays the photo's
// (RenderSettings::crop). The memory of `out` is used again.
void CropView(const TrainView& view, const PixelRect& crop, int threads, TrainView* out);

}  // namespace litags

#endif  // LITAGS_ENGINE_TRAIN_CROP_H_
