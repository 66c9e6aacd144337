#include "engine/denoise/high_pass.h"

#include <algorithm>
#include <cmath>

namespace litags {
namespace {

std::vector<double> GaussianKernel(int size, double sigma) {
  std::vector<double> kernel(size);
  double sum = 0;
  for (int i = 0; i < size; ++i) {
    const double x = i - size / 2;
    sum += kernel[i] = std::exp(-0.5 * x * x / (sigma * sigma));
  }
  for (double& k : kernel) k /= sum;
  return kernel;
}

// Mirror without repeating the edge pixel: -1 -> 1, n -> n - 2.
int Reflect101(int i, int n) {
  if (n == 1) return 0;
  const int period = 2 * (n - 1);
  i = std::abs(i) % period;
  return i < n ? i : period - i;
}

float Clamp01(float v) { return std::min(std::max(v, 0.0f), 1.0f); }

}  // namespace

Band Band::Convolution(const std::vector<double>& kernel, PdmBorder border, int length) {
  Band band;
  band.radius = static_cast<int>(kernel.size()) / 2;
  band.length = length;
  std::vector<double> coefs(kernel.size() * length, 0.0);
  for (int i = 0; i < length; ++i) {
    for (int d = -band.radius; d <= band.radius; ++d) {
      int j = i + d;
      if (border == PdmBorder::kReflect101) j = Reflect101(j, length);
      if (j < 0 || j >= length) continue;
      // A mirrored pixel is never further from i than the pixel it stands for.
      coefs[size_t(j - i + band.radius) * length + i] += kernel[d + band.radius];
    }
  }
  band.coefs.assign(coefs.begin(), coefs.end());
  return band;
}

Band Band::Transposed() const {
  Band band;
  band.radius = radius;
  band.length = length;
  band.coefs.assign(coefs.size(), 0.0f);
  for (int i = 0; i < length; ++i) {
    for (int t = 0; t <= 2 * radius; ++t) {
      const int j = i - radius + t;
      if (j < 0 || j >= length) continue;
      band.coefs[size_t(2 * radius - t) * length + j] = tap(t)[i];
    }
  }
  return band;
}

HighPass::HighPass(const PdmOptions& options)
    : kernel_(GaussianKernel(options.filter_size, options.filter_sigma)), border_(options.border) {}

void HighPass::Resize(int height, int width) {
  if (rows_.length != height) {
    rows_ = Band::Convolution(kernel_, border_, height);
    rows_transposed_ = rows_.Transposed();
  }
  if (columns_.length != width) {
    columns_ = Band::Convolution(kernel_, border_, width);
    columns_transposed_ = columns_.Transposed();
  }
}

void HighPass::Apply(const Band& rows, const Band& columns, const PaddedRows& in, int c, int y,
                     bool clamp, float* scratch, float* out) {
  const int radius = rows.radius, width = columns.length;
  float* blurred = scratch + radius;  // stays zero on both sides
  std::fill_n(blurred, width, 0.0f);
  for (int t = 0; t <= 2 * radius; ++t) {
    const int source_y = y - radius + t;
    if (source_y < 0 || source_y >= rows.length) continue;
    const float coef = rows.tap(t)[y];
    const float* source = in.row(source_y, c);
    if (clamp) {
      for (int x = 0; x < width; ++x) blurred[x] += coef * Clamp01(source[x]);
    } else {
      for (int x = 0; x < width; ++x) blurred[x] += coef * source[x];
    }
  }
  const float* centre = in.row(y, c);
  for (int x = 0; x < width; ++x) out[x] = clamp ? Clamp01(centre[x]) : centre[x];
  for (int t = 0; t <= 2 * radius; ++t) {
    const float* coefs = columns.tap(t);
    const float* source = blurred - radius + t;
    for (int x = 0; x < width; ++x) out[x] -= coefs[x] * source[x];
  }
}

}  // namespace litags
