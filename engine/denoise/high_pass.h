// The fixed high-pass filter 1 - C of the PDM and its adjoint; C = separable Gaussian.
#ifndef LITAGS_ENGINE_DENOISE_HIGH_PASS_H_
#define LITAGS_ENGINE_DENOISE_HIGH_PASS_H_

#include <cstddef>
#include <vector>

#include "engine/denoise/padded_rows.h"
#include "engine/denoise/pdm.h"

namespace litags {

// A banded matrix along one axis: out[i] = sum over t of coef(t, i) in[i - radius + t].
struct Band {
  int radius = 0;
  int length = 0;
  size_t stride = 0;         // length and zeros up to a multiple of PaddedRows::kPad
  std::vector<float> coefs;  // [2 radius + 1][stride], zero where `in` would be outside

  // Convolution with the odd, symmetric `kernel`; `border` is what lies outside.
  static Band Convolution(const std::vector<double>& kernel, PdmBorder border, int length);
  Band Transposed() const;

  const float* tap(int t) const { return coefs.data() + t * stride; }
};

// One row to filter, for the kernel. Rows are those of PaddedRows.
struct FilterJob {
  const float* centre;  // the row itself; the others lie row_stride apart
  ptrdiff_t row_stride;
  const float* row_coefs;  // coefficient t at t * row_coef_stride
  size_t row_coef_stride;
  const Band* columns;
  int radius, first, last;  // taps first..last of the rows' band are inside the image
  int width;
  bool clamp;
  float* blurred;  // [stride], zero on both sides
  float* out;
};

// 1 - C. With reflect-101 borders C is not symmetric, hence both directions as banded matrices:
// forward and adjoint are then the same loop.
class HighPass {
 public:
  explicit HighPass(const PdmOptions& options);

  void Resize(int height, int width);

  // out[x] = ((1 - C) in)[y][x] of channel c, a row of PaddedRows; `clamp` reads `in` clamped to
  // [0, 1]. scratch: ScratchSize() floats, aligned to a vector, zero-filled when first used.
  void Row(const PaddedRows& in, int c, int y, bool clamp, float* scratch, float* out) const {
    Apply(rows_, columns_, in, c, y, clamp, scratch, out);
  }
  // out[x] = ((1 - C)^T in)[y][x].
  void AdjointRow(const PaddedRows& in, int c, int y, float* scratch, float* out) const {
    Apply(rows_transposed_, columns_transposed_, in, c, y, false, scratch, out);
  }
  size_t ScratchSize() const;

 private:
  static void Apply(const Band& rows, const Band& columns, const PaddedRows& in, int c, int y,
                    bool clamp, float* scratch, float* out);

  std::vector<double> kernel_;
  PdmBorder border_;
  Band rows_, columns_, rows_transposed_, columns_transposed_;
};

}  // namespace litags

#endif  // LITAGS_ENGINE_DENOISE_HIGH_PASS_H_
