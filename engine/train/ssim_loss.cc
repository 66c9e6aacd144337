// SSIM and the reconstruction loss. Two passes over tiles of 64 x 64 pixels, each a separable
// 11-tap blur (horizontal into a ring of rows that stays in the first-level cache, then vertical):
//   1. Blur x, y, x^2 + y^2 and xy: SSIM needs only the sum of the two variances, so four maps do
//      instead of five. Gives the value and the derivatives by the blurred maps.
//   2. Blur the three derivative maps: the window is symmetric, so it is its own adjoint.
#include <algorithm>
#include <array>
#include <cmath>

#include "engine/core/aligned.h"
#include "engine/core/check.h"
#include "engine/core/parallel.h"
#include "engine/core/ssim.h"
#include "engine/train/losses.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/train/ssim_loss.cc"
#include "hwy/foreach_target.h"  // IWYU pragma: keep
// After foreach_target.
#include "engine/core/simd-inl.h"
#include "hwy/cache_control.h"

// Shared by all targets: defined by the first pass of foreach_target only.
#ifndef LITAGS_ENGINE_TRAIN_SSIM_LOSS_SHARED_
#define LITAGS_ENGINE_TRAIN_SSIM_LOSS_SHARED_
namespace litags {
namespace ssim {

constexpr int kRadius = kSsimRadius;
constexpr int kTaps = 2 * kRadius + 1;
constexpr int kTileWidth = 64;
constexpr int kTileHeight = 64;
constexpr int kPad = 16;    // zero columns on either side of a stored map; a multiple of 16
constexpr int kMargin = 8;  // columns read on either side of a tile; >= radius
// How many rows ahead memory is asked for: a tile's rows are too short for the hardware to foresee
// the next. Measured: without it the two passes together take about twice as long.
constexpr int kPrefetchRows = 4;
constexpr int kInputRow = kTileWidth + 2 * kMargin;
constexpr int kMoments = 4;      // blurred: x, y, x^2 + y^2, xy
constexpr int kDerivatives = 3;  // of SSIM by blurred x, x^2 + y^2, xy
constexpr float kK1 = kSsimK1, kK2 = kSsimK2, kC1 = kK1 * kK1, kC2 = kK2 * kK2;

// Floats of scratch per thread: the ring and one row of inputs with its margins.
constexpr size_t kRingFloats = size_t{2 * kTaps} * kMoments * kTileWidth;
constexpr size_t kScratch = kRingFloats + size_t{kMoments} * kInputRow;

// One channel of a tile: columns [x0, x0 + width) with width a multiple of 16 that may pass the
// image's edge, rows [y0, y1).
struct Tile {
  int x0, y0, y1, width;
};

// One channel of a call. Image rows are image_width apart; map rows map_stride, and `maps` point
// at column 0 of row 0, with kPad zero columns before and after.
struct Channel {
  int image_width = 0, image_height = 0;
  size_t map_stride = 0;
  const float* r = nullptr;  // x, or reflectance
  const float* l = nullptr;  // illumination; null: x is r
  const float* y = nullptr;
  const float* w = nullptr;                    // pixel weights of the L1 term; may be null
  float* v_r = nullptr;                        // may be null
  float* v_l = nullptr;                        // may be null
  std::array<float*, kDerivatives> maps = {};  // null: values only
  std::array<float, kRadius + 1> window = {};  // from the centre outwards
  float l1_gradient = 0, ssim_gradient = 0;    // dL/d(sum |x - y|), dL/d(sum of SSIM)
};

struct Sums {
  double l1 = 0, ssim = 0;
};

}  // namespace ssim
}  // namespace litags
#endif

HWY_BEFORE_NAMESPACE();
namespace litags {
namespace HWY_NAMESPACE {

// The window in registers: stores through float pointers cannot force it to be read again.
struct Window {
  Window(FloatTag d, const float* w)
      : w0(hn::Set(d, w[0])),
        w1(hn::Set(d, w[1])),
        w2(hn::Set(d, w[2])),
        w3(hn::Set(d, w[3])),
        w4(hn::Set(d, w[4])),
        w5(hn::Set(d, w[5])) {}
  FloatVec w0, w1, w2, w3, w4, w5;
};

// Weighted sum of the vectors at p - 5 step to p + 5 step.
HWY_INLINE FloatVec Blur(FloatTag d, const Window& w, const float* p, ptrdiff_t step) {
  const auto pair = [&](int k) HWY_ATTR {
    return hn::Add(hn::LoadU(d, p - k * step), hn::LoadU(d, p + k * step));
  };
  auto sum = hn::Mul(w.w0, hn::LoadU(d, p));
  sum = hn::MulAdd(w.w1, pair(1), sum);
  sum = hn::MulAdd(w.w2, pair(2), sum);
  sum = hn::MulAdd(w.w3, pair(3), sum);
  sum = hn::MulAdd(w.w4, pair(4), sum);
  return hn::MulAdd(w.w5, pair(5), sum);
}

// The last 11 horizontally blurred rows of kMaps maps. Every row is written twice, 11 slots
// apart, so that any 11 consecutive rows lie one after the other in memory.
template <int kMaps>
class Ring {
 public:
  static constexpr ptrdiff_t kRow = ptrdiff_t{kMaps} * ssim::kTileWidth;

  explicit Ring(float* data) : data_(data) {}

  // Row y of `map` from in[-5, width + 5).
  HWY_INLINE void BlurIn(const Window& w, const float* in, int width, int y, int map) {
    const FloatTag d;
    float* out = slot(y) + map * ssim::kTileWidth;
    for (int i = 0; i < width; i += static_cast<int>(hn::Lanes(d))) {
      const auto blurred = Blur(d, w, in + i, 1);
      hn::StoreU(blurred, d, out + i);
      hn::StoreU(blurred, d, out + ssim::kTaps * kRow + i);
    }
  }
  void Clear(int y) {
    std::fill_n(slot(y), kRow, 0.0f);
    std::fill_n(slot(y) + ssim::kTaps * kRow, kRow, 0.0f);
  }

  // Map 0 of row y; rows y - 5 to y + 5 are kRow apart around it.
  const float* Center(int y) const { return slot(y - ssim::kRadius) + ssim::kRadius * kRow; }

 private:
  float* slot(int y) const { return data_ + (y + ssim::kTaps) % ssim::kTaps * kRow; }

  float* data_;
};

// Asks for the tile's part of row y + kPrefetchRows of a plane; null: no plane.
HWY_INLINE void PrefetchAhead(const float* plane, size_t stride, const ssim::Tile& tile, int y) {
  if (plane == nullptr) return;
  const float* ahead = plane + static_cast<size_t>(y + ssim::kPrefetchRows) * stride + tile.x0;
  for (int i = 0; i < tile.width; i += 16) hwy::Prefetch(ahead + i);
}

// Row y of the four maps to be blurred, columns x0 - 8 to x0 + width + 8, zero outside the
// image. Returns the L1 sum of the tile's own columns.
HWY_INLINE double FillInputs(const ssim::Channel& c, const ssim::Tile& tile, int y, float* inputs,
                             bool sum_l1) {
  const FloatTag d;
  constexpr int kRow = ssim::kInputRow;
  const int left = std::max(0, tile.x0 - ssim::kMargin);
  const int right = std::min(c.image_width, tile.x0 + tile.width + ssim::kMargin);
  const int skip = left - (tile.x0 - ssim::kMargin);
  float *x_row = inputs + skip, *y_row = x_row + kRow, *s_row = y_row + kRow, *p_row = s_row + kRow;
  const size_t offset = static_cast<size_t>(y) * c.image_width + left;
  const float *r = c.r + offset, *l = c.l == nullptr ? nullptr : c.l + offset, *t = c.y + offset;
  ForVectors(right - left, [&](size_t i, auto lanes) HWY_ATTR {
    auto x = Load(d, r + i, lanes);
    if (l != nullptr) x = hn::Mul(x, Load(d, l + i, lanes));
    const auto target = Load(d, t + i, lanes);
    Store(d, x, x_row + i, lanes);
    Store(d, target, y_row + i, lanes);
    Store(d, hn::MulAdd(x, x, hn::Mul(target, target)), s_row + i, lanes);
    Store(d, hn::Mul(x, target), p_row + i, lanes);
  });
  if (!sum_l1) return 0;

  const int own = std::min(c.image_width - tile.x0, tile.width);
  const float *own_x = inputs + ssim::kMargin, *own_y = own_x + kRow;
  const float* w =
      c.w == nullptr ? nullptr : c.w + static_cast<size_t>(y) * c.image_width + tile.x0;
  auto sum = hn::Zero(d);
  ForVectors(own, [&](size_t i, auto lanes) HWY_ATTR {
    auto diff = hn::Abs(hn::Sub(Load(d, own_x + i, lanes), Load(d, own_y + i, lanes)));
    if (w != nullptr) diff = hn::Mul(diff, Load(d, w + i, lanes));
    sum = hn::Add(sum, diff);
  });
  return Sum(d, sum);
}

// Row y of the SSIM map from its horizontally blurred moments: returns its sum and stores the
// derivatives.
HWY_INLINE double SsimRow(const ssim::Channel& c, const ssim::Tile& tile, int y,
                          const Window& window, const float* moments) {
  constexpr ptrdiff_t kRow = Ring<ssim::kMoments>::kRow;
  const FloatTag d;
  const auto c1 = hn::Set(d, ssim::kC1), c2 = hn::Set(d, ssim::kC2), two = hn::Set(d, 2.0f);
  const size_t offset = static_cast<size_t>(y) * c.map_stride + tile.x0;
  auto sum = hn::Zero(d);
  for (int i = 0; i < tile.width; i += static_cast<int>(hn::Lanes(d))) {
    const auto mx = Blur(d, window, moments + 0 * ssim::kTileWidth + i, kRow);
    const auto my = Blur(d, window, moments + 1 * ssim::kTileWidth + i, kRow);
    const auto s = Blur(d, window, moments + 2 * ssim::kTileWidth + i, kRow);
    const auto p = Blur(d, window, moments + 3 * ssim::kTileWidth + i, kRow);
    const auto mm = hn::Mul(mx, my), squares = hn::MulAdd(mx, mx, hn::Mul(my, my));
    const auto a1 = hn::MulAdd(two, mm, c1), b1 = hn::Add(squares, c1);
    const auto a2 = hn::MulAdd(two, hn::Sub(p, mm), c2);
    // Rounding must not make the variance negative.
    const auto b2 = hn::Add(hn::Max(hn::Sub(s, squares), hn::Zero(d)), c2);
    // Past the image's right edge the map counts for nothing.
    const int inside = c.image_width - tile.x0 - i;
    auto inverse = hn::Div(hn::Set(d, 1.0f), hn::Mul(b1, b2));
    if (inside < static_cast<int>(hn::Lanes(d))) {
      inverse = hn::IfThenElseZero(hn::FirstN(d, std::max(0, inside)), inverse);
    }
    const auto value = hn::Mul(hn::Mul(a1, a2), inverse);
    sum = hn::Add(sum, value);
    if (c.maps[0] == nullptr) continue;
    // S = a1 a2 / (b1 b2); by mx with s and p held; by s; by p.
    const auto by_mx =
        hn::Sub(hn::Mul(my, hn::Sub(a2, a1)), hn::Mul(hn::Mul(mx, value), hn::Sub(b2, b1)));
    hn::StoreU(hn::Mul(hn::Mul(two, inverse), by_mx), d, c.maps[0] + offset + i);
    hn::StoreU(hn::Neg(hn::Mul(hn::Mul(value, b1), inverse)), d, c.maps[1] + offset + i);
    hn::StoreU(hn::Mul(hn::Mul(two, a1), inverse), d, c.maps[2] + offset + i);
  }
  return Sum(d, sum);
}

// The zeros beside row y of the maps, if the tile is the first or last of its row.
HWY_INLINE void StorePads(const ssim::Channel& c, const ssim::Tile& tile, int y) {
  if (c.maps[0] == nullptr) return;
  const int end = tile.x0 + tile.width;
  for (float* map : c.maps) {
    float* row = map + static_cast<size_t>(y) * c.map_stride;
    if (tile.x0 == 0) std::fill_n(row - ssim::kPad, ssim::kPad, 0.0f);
    if (end >= c.image_width) std::fill_n(row + end, ssim::kPad, 0.0f);
  }
}

// Pass 1 over one tile.
ssim::Sums SsimForwardTile(const ssim::Channel& c, const ssim::Tile& tile, float* scratch) {
  const Window window(FloatTag(), c.window.data());
  Ring<ssim::kMoments> ring(scratch);
  float* inputs = scratch + ssim::kRingFloats;
  std::fill_n(inputs, ssim::kMoments * ssim::kInputRow, 0.0f);
  ssim::Sums sums;
  for (int y = tile.y0 - ssim::kRadius; y < tile.y1 + ssim::kRadius; ++y) {
    if (y < 0 || y >= c.image_height) {
      ring.Clear(y);
    } else {
      for (const float* image : {c.r, c.l, c.y}) PrefetchAhead(image, c.image_width, tile, y);
      sums.l1 += FillInputs(c, tile, y, inputs, y >= tile.y0 && y < tile.y1);
      for (int m = 0; m < ssim::kMoments; ++m) {
        ring.BlurIn(window, inputs + m * ssim::kInputRow + ssim::kMargin, tile.width, y, m);
      }
    }
    if (y < tile.y0 + ssim::kRadius) continue;
    for (const float* map : c.maps) PrefetchAhead(map, c.map_stride, tile, y - ssim::kRadius);
    sums.ssim += SsimRow(c, tile, y - ssim::kRadius, window, ring.Center(y - ssim::kRadius));
    StorePads(c, tile, y - ssim::kRadius);
  }
  return sums;
}

// Row y of the gradient from the horizontally blurred derivative maps:
// dS/dx_i = blur(by_mx) + 2 x_i blur(by_s) + y_i blur(by_p).
HWY_INLINE void GradientRow(const ssim::Channel& c, const ssim::Tile& tile, int y,
                            const Window& window, const float* derivatives) {
  constexpr ptrdiff_t kRow = Ring<ssim::kDerivatives>::kRow;
  const FloatTag d;
  const auto ssim_gradient = hn::Set(d, c.ssim_gradient), l1_gradient = hn::Set(d, c.l1_gradient);
  const size_t row = static_cast<size_t>(y) * c.image_width + tile.x0;
  const int own = std::min(c.image_width - tile.x0, tile.width);
  ForVectors(own, [&](size_t i, auto lanes) HWY_ATTR {
    const size_t at = row + i;
    const auto r = Load(d, c.r + at, lanes);
    const auto l = c.l == nullptr ? hn::Set(d, 1.0f) : Load(d, c.l + at, lanes);
    const auto x = hn::Mul(r, l), target = Load(d, c.y + at, lanes);
    const auto by_mx = Blur(d, window, derivatives + 0 * ssim::kTileWidth + i, kRow);
    const auto by_s = Blur(d, window, derivatives + 1 * ssim::kTileWidth + i, kRow);
    const auto by_p = Blur(d, window, derivatives + 2 * ssim::kTileWidth + i, kRow);
    const auto slope = hn::MulAdd(hn::Add(x, x), by_s, hn::MulAdd(target, by_p, by_mx));
    auto sign = Sign(d, hn::Sub(x, target));
    if (c.w != nullptr) sign = hn::Mul(sign, Load(d, c.w + at, lanes));
    const auto v = hn::MulAdd(ssim_gradient, slope, hn::Mul(l1_gradient, sign));
    if (c.v_r != nullptr) {
      Store(d, hn::MulAdd(v, l, Load(d, c.v_r + at, lanes)), c.v_r + at, lanes);
    }
    if (c.v_l != nullptr) {
      Store(d, hn::MulAdd(v, r, Load(d, c.v_l + at, lanes)), c.v_l + at, lanes);
    }
  });
}

// Pass 2 over one tile.
void SsimBackwardTile(const ssim::Channel& c, const ssim::Tile& tile, float* scratch) {
  const Window window(FloatTag(), c.window.data());
  Ring<ssim::kDerivatives> ring(scratch);
  for (int y = tile.y0 - ssim::kRadius; y < tile.y1 + ssim::kRadius; ++y) {
    if (y < 0 || y >= c.image_height) {
      ring.Clear(y);
    } else {
      const size_t offset = static_cast<size_t>(y) * c.map_stride + tile.x0;
      for (int m = 0; m < ssim::kDerivatives; ++m) {
        PrefetchAhead(c.maps[m], c.map_stride, tile, y);
        ring.BlurIn(window, c.maps[m] + offset, tile.width, y, m);
      }
    }
    if (y < tile.y0 + ssim::kRadius) continue;
    for (const float* plane :
         {c.r, c.l, c.y, static_cast<const float*>(c.v_r), static_cast<const float*>(c.v_l)}) {
      PrefetchAhead(plane, c.image_width, tile, y - ssim::kRadius);
    }
    GradientRow(c, tile, y - ssim::kRadius, window, ring.Center(y - ssim::kRadius));
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace litags
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace litags {
namespace {

HWY_EXPORT(SsimForwardTile);
HWY_EXPORT(SsimBackwardTile);

// The normalised Gaussian window, from the centre outwards.
std::array<float, ssim::kRadius + 1> Window() {
  std::array<double, ssim::kRadius + 1> g;
  double sum = 0;
  for (int i = 0; i <= ssim::kRadius; ++i) {
    g[i] = std::exp(-i * i / (2 * kSsimSigma * kSsimSigma));
    sum += i == 0 ? g[i] : 2 * g[i];
  }
  std::array<float, ssim::kRadius + 1> window;
  for (int i = 0; i <= ssim::kRadius; ++i) window[i] = static_cast<float>(g[i] / sum);
  return window;
}

struct Inputs {
  PlanesView r, l, y, w;
  PlanesSpan v_r, v_l;
};

bool HasSize(PlanesView view, PlanesView like, int channels) {
  return view.empty() ||
         (view.channels == channels && view.height == like.height && view.width == like.width);
}

// The tiles of one channel, and how its derivative maps are laid out.
struct Layout {
  Layout(int channels, int height, int width)
      : columns((width + 15) / 16 * 16),
        stride(columns + 2 * ssim::kPad),
        tiles_x((columns + ssim::kTileWidth - 1) / ssim::kTileWidth),
        tiles_y((height + ssim::kTileHeight - 1) / ssim::kTileHeight),
        map_size(stride * height),
        tasks(size_t(channels) * tiles_x * tiles_y) {}

  int columns;    // width, to whole vectors
  size_t stride;  // floats between map rows
  int tiles_x, tiles_y;
  size_t map_size;  // floats
  size_t tasks;

  int channel(size_t task) const { return static_cast<int>(task / (tiles_x * tiles_y)); }
  ssim::Tile tile(size_t task, int height) const {
    const int index = static_cast<int>(task % (tiles_x * tiles_y));
    const int x0 = index % tiles_x * ssim::kTileWidth, y0 = index / tiles_x * ssim::kTileHeight;
    return {x0, y0, std::min(y0 + ssim::kTileHeight, height),
            std::min(ssim::kTileWidth, columns - x0)};
  }
};

// Sums of |x - y| and SSIM over all samples; adds the gradients given dL/d(either sum).
ssim::Sums Run(const Inputs& in, double l1_gradient, double ssim_gradient, LossWorkspace& ws) {
  const PlanesView& r = in.r;
  LITAGS_CHECK(r.size() > 0 && HasSize(in.y, r, r.channels) && !in.y.empty());
  LITAGS_CHECK(HasSize(in.l, r, r.channels) && HasSize(in.w, r, 1));
  LITAGS_CHECK(HasSize(in.v_r, r, r.channels) && HasSize(in.v_l, r, r.channels));
  LITAGS_CHECK(in.v_l.empty() || !in.l.empty());
  static const std::array<float, ssim::kRadius + 1> window = Window();
  const bool differentiate = !in.v_r.empty() || !in.v_l.empty();
  const Layout layout(r.channels, r.height, r.width);
  const int threads = ws.threads > 0 ? ws.threads : DefaultThreadCount();
  ws.rows.resize(std::max(ws.rows.size(), threads * ssim::kScratch));
  ws.partials.assign(2 * layout.tasks, 0.0);
  if (differentiate) {
    ResizeScratch(ssim::kDerivatives * r.channels * layout.map_size, &ws.ssim_maps);
  }

  const auto make_channel = [&](int c) {
    ssim::Channel channel;
    channel.image_width = r.width;
    channel.image_height = r.height;
    channel.map_stride = layout.stride;
    channel.r = r.plane(c);
    channel.y = in.y.plane(c);
    if (!in.l.empty()) channel.l = in.l.plane(c);
    if (!in.w.empty()) channel.w = in.w.data;
    if (!in.v_r.empty()) channel.v_r = in.v_r.plane(c);
    if (!in.v_l.empty()) channel.v_l = in.v_l.plane(c);
    for (int m = 0; differentiate && m < ssim::kDerivatives; ++m) {
      channel.maps[m] =
          ws.ssim_maps.data() + (size_t(c) * ssim::kDerivatives + m) * layout.map_size + ssim::kPad;
    }
    channel.window = window;
    channel.l1_gradient = static_cast<float>(l1_gradient);
    channel.ssim_gradient = static_cast<float>(ssim_gradient);
    return channel;
  };
  const auto forward = HWY_DYNAMIC_DISPATCH(SsimForwardTile);
  ParallelFor(threads, layout.tasks, [&](size_t task, int thread) {
    const ssim::Sums sums = forward(make_channel(layout.channel(task)), layout.tile(task, r.height),
                                    ws.rows.data() + thread * ssim::kScratch);
    ws.partials[2 * task] = sums.l1;
    ws.partials[2 * task + 1] = sums.ssim;
  });
  ssim::Sums total;
  for (size_t task = 0; task < layout.tasks; ++task) {
    total.l1 += ws.partials[2 * task];
    total.ssim += ws.partials[2 * task + 1];
  }
  if (!differentiate) return total;
  const auto backward = HWY_DYNAMIC_DISPATCH(SsimBackwardTile);
  ParallelFor(threads, layout.tasks, [&](size_t task, int thread) {
    backward(make_channel(layout.channel(task)), layout.tile(task, r.height),
             ws.rows.data() + thread * ssim::kScratch);
  });
  return total;
}

double Reconstruction(const Inputs& in, double weight, const ReconstructionWeights& weights,
                      LossWorkspace& ws) {
  const double n = static_cast<double>(in.r.size());
  const ssim::Sums sums = Run(in, weight * weights.l1 / n, -weight * weights.ssim / n, ws);
  return weight * (weights.l1 * sums.l1 / n + weights.ssim * (1 - sums.ssim / n));
}

}  // namespace

double SsimLoss(PlanesView x, PlanesView y, double weight, PlanesSpan v_x, LossWorkspace& ws) {
  return Reconstruction({x, {}, y, {}, v_x, {}}, weight, {.l1 = 0, .ssim = 1}, ws);
}

double ReconstructionLoss(PlanesView x, PlanesView y, double weight, PlanesSpan v_x,
                          LossWorkspace& ws, const ReconstructionWeights& weights,
                          PlanesView pixel_weights) {
  return Reconstruction({x, {}, y, pixel_weights, v_x, {}}, weight, weights, ws);
}

double ProductReconstructionLoss(PlanesView reflectance, PlanesView illumination, PlanesView y,
                                 double weight, PlanesSpan v_reflectance, PlanesSpan v_illumination,
                                 LossWorkspace& ws, const ReconstructionWeights& weights,
                                 PlanesView pixel_weights) {
  LITAGS_CHECK(!illumination.empty());
  return Reconstruction(
      {reflectance, illumination, y, pixel_weights, v_reflectance, v_illumination}, weight, weights,
      ws);
}

}  // namespace litags
#endif  // HWY_ONCE
