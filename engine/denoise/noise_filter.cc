#include "engine/denoise/noise_filter.h"

#include <algorithm>

#include "engine/core/check.h"
#include "engine/core/color.h"
#include "engine/core/parallel.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/denoise/noise_filter.cc"
#include "hwy/foreach_target.h"  // IWYU pragma: keep
// After foreach_target.
#include "engine/core/simd-inl.h"

// Shared by all targets: defined by the first pass of foreach_target only.
#ifndef LITAGS_ENGINE_DENOISE_NOISE_FILTER_SHARED_
#define LITAGS_ENGINE_DENOISE_NOISE_FILTER_SHARED_
namespace litags {
namespace noise_filter {

constexpr int kRadius = 2, kWindow = 2 * kRadius + 1;
constexpr float kPerWindow = 1.0f / (kWindow * kWindow);
constexpr int kMaps = 4;
constexpr int kPad = 16;           // floats on either side of a scratch row, >= a vector
constexpr size_t kRowsATask = 16;  // of the picture

// The rows of a window's height around row y, top to bottom, of a picture or of the maps.
struct WindowRows {
  WindowRows(const float* planes, int channels, int height, int width, int y) {
    for (int c = 0; c < channels; ++c) {
      for (int k = 0; k < kWindow; ++k) {
        const int row = std::clamp(y + k - kRadius, 0, height - 1);
        at[c][k] = planes + (size_t(c) * height + row) * width;
      }
    }
  }
  const float* at[kMaps][kWindow];
};

// Four rows of sums over a window's height, with what the window reads beyond the ends.
class Sums {
 public:
  static size_t Stride(int width) { return (width + kPad - 1) / kPad * kPad + 2 * kPad; }

  Sums(float* scratch, int width) : data_(scratch + kPad), width_(width), stride_(Stride(width)) {}

  float* row(int map) { return data_ + map * stride_; }

  void ContinueEdges() {
    for (int map = 0; map < kMaps; ++map) {
      float* sums = row(map);
      std::fill_n(sums - kRadius, kRadius, sums[0]);
      std::fill_n(sums + width_, kRadius, sums[width_ - 1]);
    }
  }

 private:
  float* data_;
  int width_;
  size_t stride_;
};

}  // namespace noise_filter
}  // namespace litags
#endif

HWY_BEFORE_NAMESPACE();
namespace litags {
namespace HWY_NAMESPACE {
namespace {

using noise_filter::kMaps;
using noise_filter::kWindow;
using noise_filter::Sums;
using noise_filter::WindowRows;

HWY_INLINE FloatVec Luma(FloatTag d, FloatVec r, FloatVec g, FloatVec b) {
  const auto red = hn::Mul(hn::Set(d, kLumaRed), r);
  return hn::MulAdd(hn::Set(d, kLumaBlue), b, hn::MulAdd(hn::Set(d, kLumaGreen), g, red));
}

// Mean over the window from the sums over its height.
HWY_INLINE FloatVec WindowMean(FloatTag d, const float* sums) {
  auto sum = hn::LoadU(d, sums);
  for (int k = 1; k <= noise_filter::kRadius; ++k) {
    sum = hn::Add(sum, hn::Add(hn::LoadU(d, sums - k), hn::LoadU(d, sums + k)));
  }
  return hn::Mul(sum, hn::Set(d, noise_filter::kPerWindow));
}

// What the windows around the pixels of a row say: a, and (1 - a) mean of each channel.
void WindowRow(const WindowRows& rows, const NoiseCurve& noise, int width, Sums sums,
               float* const* maps) {
  const FloatTag d;
  ForVectors(width, [&](size_t i, auto lanes) HWY_ATTR {
    auto r = hn::Zero(d), g = r, b = r, squares = r;
    for (int k = 0; k < kWindow; ++k) {
      const auto red = Load(d, rows.at[0][k] + i, lanes), green = Load(d, rows.at[1][k] + i, lanes),
                 blue = Load(d, rows.at[2][k] + i, lanes);
      const auto luma = Luma(d, red, green, blue);
      r = hn::Add(r, red);
      g = hn::Add(g, green);
      b = hn::Add(b, blue);
      squares = hn::MulAdd(luma, luma, squares);
    }
    Store(d, r, sums.row(0) + i, lanes);
    Store(d, g, sums.row(1) + i, lanes);
    Store(d, b, sums.row(2) + i, lanes);
    Store(d, squares, sums.row(3) + i, lanes);
  });
  sums.ContinueEdges();

  const auto one = hn::Set(d, 1.0f), last = hn::Set(d, float(noise.size() - 1));
  ForVectors(width, [&](size_t i, auto lanes) HWY_ATTR {
    const auto r = WindowMean(d, sums.row(0) + i), g = WindowMean(d, sums.row(1) + i),
               b = WindowMean(d, sums.row(2) + i);
    const auto luma = Luma(d, r, g, b);
    const auto v = hn::NegMulAdd(luma, luma, WindowMean(d, sums.row(3) + i));
    // 0 for a NaN, too.
    const auto code =
        hn::IfThenElseZero(hn::Gt(luma, hn::Zero(d)), hn::Min(hn::Mul(luma, last), last));
    const auto n = hn::GatherIndex(d, noise.data(), hn::NearestInt(code));
    const auto signal = hn::NegMulAdd(n, n, v);
    const auto a = hn::IfThenElseZero(hn::Gt(signal, hn::Zero(d)), hn::Div(signal, v));
    const auto rest = hn::Sub(one, a);
    Store(d, a, maps[0] + i, lanes);
    Store(d, hn::Mul(rest, r), maps[1] + i, lanes);
    Store(d, hn::Mul(rest, g), maps[2] + i, lanes);
    Store(d, hn::Mul(rest, b), maps[3] + i, lanes);
  });
}

// A row of the picture becomes the mean of what the windows around each pixel say.
void PixelRow(const WindowRows& maps, int width, Sums sums, float* const* color) {
  const FloatTag d;
  ForVectors(width, [&](size_t i, auto lanes) HWY_ATTR {
    for (int m = 0; m < kMaps; ++m) {
      auto sum = hn::Zero(d);
      for (int k = 0; k < kWindow; ++k) sum = hn::Add(sum, Load(d, maps.at[m][k] + i, lanes));
      Store(d, sum, sums.row(m) + i, lanes);
    }
  });
  sums.ContinueEdges();
  ForVectors(width, [&](size_t i, auto lanes) HWY_ATTR {
    const auto a = WindowMean(d, sums.row(0) + i);
    for (int c = 0; c < 3; ++c) {
      const auto x = Load(d, color[c] + i, lanes);
      Store(d, hn::MulAdd(a, x, WindowMean(d, sums.row(1 + c) + i)), color[c] + i, lanes);
    }
  });
}

}  // namespace
}  // namespace HWY_NAMESPACE
}  // namespace litags
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace litags {
namespace {

HWY_EXPORT(WindowRow);
HWY_EXPORT(PixelRow);

}  // namespace

void NoiseFilter::Apply(const NoiseCurve& noise, PlanesSpan color) {
  using namespace noise_filter;
  LITAGS_CHECK(color.channels == 3);
  const int height = color.height, width = color.width;
  const int threads = threads_ > 0 ? threads_ : DefaultThreadCount();
  const size_t plane = color.plane_size(), scratch = kMaps * Sums::Stride(width);
  maps_.resize(kMaps * plane);
  scratch_.resize(threads * scratch);
  const size_t tasks = (height + kRowsATask - 1) / kRowsATask;
  const auto for_rows = [&](const auto& body) {
    ParallelFor(threads, tasks, [&](size_t task, int thread) {
      const int end = std::min<int>(height, (task + 1) * kRowsATask);
      for (int y = task * kRowsATask; y < end; ++y) {
        body(y, Sums(scratch_.data() + thread * scratch, width));
      }
    });
  };
  for_rows([&](int y, Sums sums) {
    float* const maps = maps_.data() + size_t(y) * width;
    float* const row[kMaps] = {maps, maps + plane, maps + 2 * plane, maps + 3 * plane};
    HWY_DYNAMIC_DISPATCH(WindowRow)
    (WindowRows(color.data, 3, height, width, y), noise, width, sums, row);
  });
  for_rows([&](int y, Sums sums) {
    float* const first = color.data + size_t(y) * width;
    float* const row[3] = {first, first + plane, first + 2 * plane};
    HWY_DYNAMIC_DISPATCH(PixelRow)
    (WindowRows(maps_.data(), kMaps, height, width, y), width, sums, row);
  });
}

}  // namespace litags
#endif  // HWY_ONCE
