// The layout that the module's kernels work on.
#ifndef LITAGS_ENGINE_DENOISE_PADDED_ROWS_H_
#define LITAGS_ENGINE_DENOISE_PADDED_ROWS_H_

#include <algorithm>
#include <cstddef>

#include "hwy/aligned_allocator.h"

namespace litags {

// [H + 2][C][stride]: the channels of an image row lie beside each other, so that the three rows
// a 3x3 convolution reads are one short range of memory. Everything outside the image (one row
// above and below, kPad floats left and right, up to the next multiple of kPad) is zero and stays
// zero: kernels store whole vectors, with zeros past the width. Not copyable.
class PaddedRows {
 public:
  static constexpr size_t kPad = 16;  // floats: one AVX-512 vector

  // n, up to a multiple of kPad.
  static constexpr size_t RoundUp(size_t n) { return (n + kPad - 1) / kPad * kPad; }

  int channels() const { return channels_; }
  int height() const { return height_; }
  int width() const { return width_; }
  size_t stride() const { return stride_; }                  // from one channel to the next
  size_t row_stride() const { return stride_ * channels_; }  // from one row to the next

  // Sets the shape. If it changed, the image's values are not set; memory is only taken for more
  // than there was before: crops of a photo differ in size from iteration to iteration.
  void Resize(int channels, int height, int width) {
    if (channels == channels_ && height == height_ && width == width_) return;
    channels_ = channels;
    height_ = height;
    width_ = width;
    stride_ = RoundUp(width) + 2 * kPad;
    const size_t count = row_stride() * (height + 2);
    if (count > capacity_) {
      data_.reset();
      data_ = hwy::AllocateAligned<float>(count);
      capacity_ = count;
    }
    ClearPadding();
  }

  // Pixel (0, y) of channel c; y = -1 and y = height are the zero rows. Aligned to a vector.
  float* row(int y, int c) { return data_.get() + Offset(y, c); }
  const float* row(int y, int c) const { return data_.get() + Offset(y, c); }

 private:
  size_t Offset(int y, int c) const {
    return (static_cast<size_t>(y + 1) * channels_ + c) * stride_ + kPad;
  }

  void ClearPadding() {
    std::fill_n(row(-1, 0) - kPad, row_stride(), 0.0f);
    std::fill_n(row(height_, 0) - kPad, row_stride(), 0.0f);
    for (int y = 0; y < height_; ++y) {
      for (int c = 0; c < channels_; ++c) {
        float* const pixels = row(y, c);
        std::fill_n(pixels - kPad, kPad, 0.0f);
        std::fill(pixels + width_, pixels - kPad + stride_, 0.0f);
      }
    }
  }

  int channels_ = 0, height_ = 0, width_ = 0;
  size_t stride_ = 0, capacity_ = 0;
  hwy::AlignedFreeUniquePtr<float[]> data_;
};

}  // namespace litags

#endif  // LITAGS_ENGINE_DENOISE_PADDED_ROWS_H_
