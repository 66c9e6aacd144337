#include "engine/denoise/high_pass.h"

#include <algorithm>
#include <cmath>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/denoise/high_pass.cc"
#include "hwy/foreach_target.h"  // IWYU pragma: keep
#include "hwy/highway.h"

HWY_BEFORE_NAMESPACE();
namespace litags {
namespace HWY_NAMESPACE {
namespace {

namespace hn = hwy::HWY_NAMESPACE;
using D = hn::CappedTag<float, 16>;  // rows are padded for 16
using V = hn::Vec<D>;

template <bool kClamp>
HWY_INLINE V LoadPixels(const float* from) {
  const D d;
  const V v = hn::Load(d, from);
  return kClamp ? hn::Min(hn::Max(v, hn::Zero(d)), hn::Set(d, 1.0f)) : v;
}

// Whole vectors: sources, coefficients and so the output are zero past the width.
template <bool kClamp>
void Filter(const FilterJob& job) {
  const D d;
  constexpr int N = hn::MaxLanes(d);
  for (int x = 0; x < job.width; x += N) {
    V sum = hn::Zero(d);
    for (int t = job.first; t <= job.last; ++t) {
      const float* source = job.centre + (t - job.radius) * job.row_stride + x;
      sum = hn::MulAdd(hn::Set(d, job.row_coefs[t * job.row_coef_stride]),
                       LoadPixels<kClamp>(source), sum);
    }
    hn::Store(sum, d, job.blurred + x);
  }
  for (int x = 0; x < job.width; x += N) {
    V sum = LoadPixels<kClamp>(job.centre + x);
    for (int t = 0; t <= 2 * job.radius; ++t) {
      sum = hn::NegMulAdd(hn::LoadU(d, job.columns->tap(t) + x),
                          hn::LoadU(d, job.blurred + x + t - job.radius), sum);
    }
    hn::Store(sum, d, job.out + x);
  }
}

void FilterRow(const FilterJob& job) { return job.clamp ? Filter<true>(job) : Filter<false>(job); }

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace litags
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace litags {
namespace {

HWY_EXPORT(FilterRow);

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

}  // namespace

Band Band::Convolution(const std::vector<double>& kernel, PdmBorder border, int length) {
  Band band;
  band.radius = static_cast<int>(kernel.size()) / 2;
  band.length = length;
  band.stride = PaddedRows::RoundUp(length);
  std::vector<double> coefs(kernel.size() * band.stride, 0.0);
  for (int i = 0; i < length; ++i) {
    for (int d = -band.radius; d <= band.radius; ++d) {
      int j = i + d;
      if (border == PdmBorder::kReflect101) j = Reflect101(j, length);
      if (j < 0 || j >= length) continue;
      // A mirrored pixel is never further from i than the pixel it stands for.
      coefs[(j - i + band.radius) * band.stride + i] += kernel[d + band.radius];
    }
  }
  band.coefs.assign(coefs.begin(), coefs.end());
  return band;
}

Band Band::Transposed() const {
  Band band;
  band.radius = radius;
  band.length = length;
  band.stride = stride;
  band.coefs.assign(coefs.size(), 0.0f);
  for (int i = 0; i < length; ++i) {
    for (int t = 0; t <= 2 * radius; ++t) {
      const int j = i - radius + t;
      if (j < 0 || j >= length) continue;
      band.coefs[(2 * radius - t) * stride + j] = tap(t)[i];
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

size_t HighPass::ScratchSize() const { return columns_.stride + 2 * PaddedRows::kPad; }

void HighPass::Apply(const Band& rows, const Band& columns, const PaddedRows& in, int c, int y,
                     bool clamp, float* scratch, float* out) {
  const int radius = rows.radius;
  FilterJob job;
  job.columns = &columns;
  job.centre = in.row(y, c);
  job.row_stride = static_cast<ptrdiff_t>(in.row_stride());
  job.row_coefs = rows.coefs.data() + y;
  job.row_coef_stride = rows.stride;
  job.radius = radius;
  job.first = std::max(0, radius - y);
  job.last = std::min(2 * radius, radius + rows.length - 1 - y);
  job.width = columns.length;
  job.clamp = clamp;
  job.blurred = scratch + PaddedRows::kPad;
  job.out = out;
  HWY_DYNAMIC_DISPATCH(FilterRow)(job);
}

}  // namespace litags
#endif  // HWY_ONCE
