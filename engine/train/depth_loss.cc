#include "engine/train/depth_loss.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "engine/core/check.h"
#include "engine/core/parallel.h"
#include "engine/core/rng.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/train/depth_loss.cc"
#include "hwy/foreach_target.h"  // IWYU pragma: keep
// After foreach_target.
#include "engine/core/simd-inl.h"

// Shared by all targets: defined by the first pass of foreach_target only.
#ifndef LITAGS_ENGINE_TRAIN_DEPTH_LOSS_SHARED_
#define LITAGS_ENGINE_TRAIN_DEPTH_LOSS_SHARED_
namespace litags {
namespace depth {

// Weighted sums over a region.
struct Sums {
  double w = 0, a = 0, b = 0, aa = 0, bb = 0, ab = 0;
};

// dL/da_i = w_i (by_a (a_i - mean_a) + by_b (b_i - mean_b)).
struct Slope {
  float by_a = 0, by_b = 0, mean_a = 0, mean_b = 0;
};

}  // namespace depth
}  // namespace litags
#endif

HWY_BEFORE_NAMESPACE();
namespace litags {
namespace HWY_NAMESPACE {

// Adds the sums of n pixels; w may be null. In double, because the variances are differences.
void AddSums(const float* a, const float* b, const float* w, size_t n, depth::Sums* sums) {
  const HWY_CAPPED(double, 8) d;
  const hn::Rebind<float, decltype(d)> df;
  const auto load = [&](const float* p) HWY_ATTR { return hn::PromoteTo(d, hn::LoadU(df, p)); };
  auto sw = hn::Zero(d), sa = sw, sb = sw, saa = sw, sbb = sw, sab = sw;
  const size_t step = hn::Lanes(d);
  size_t i = 0;
  for (; i + step <= n; i += step) {
    const auto va = load(a + i), vb = load(b + i);
    const auto vw = w == nullptr ? hn::Set(d, 1.0) : load(w + i);
    const auto wa = hn::Mul(vw, va), wb = hn::Mul(vw, vb);
    sw = hn::Add(sw, vw);
    sa = hn::Add(sa, wa);
    sb = hn::Add(sb, wb);
    saa = hn::MulAdd(wa, va, saa);
    sbb = hn::MulAdd(wb, vb, sbb);
    sab = hn::MulAdd(wa, vb, sab);
  }
  const auto total = [&](auto v) HWY_ATTR { return hn::GetLane(hn::SumOfLanes(d, v)); };
  sums->w += total(sw);
  sums->a += total(sa);
  sums->b += total(sb);
  sums->aa += total(saa);
  sums->bb += total(sbb);
  sums->ab += total(sab);
  for (; i < n; ++i) {
    const double va = a[i], vb = b[i], vw = w == nullptr ? 1.0 : w[i];
    sums->w += vw;
    sums->a += vw * va;
    sums->b += vw * vb;
    sums->aa += vw * va * va;
    sums->bb += vw * vb * vb;
    sums->ab += vw * va * vb;
  }
}

// v_i += dL/da_i.
void AddSlope(const float* a, const float* b, const float* w, size_t n, const depth::Slope& slope,
              float* v) {
  const FloatTag d;
  const auto by_a = hn::Set(d, slope.by_a), by_b = hn::Set(d, slope.by_b);
  const auto mean_a = hn::Set(d, slope.mean_a), mean_b = hn::Set(d, slope.mean_b);
  ForVectors(n, [&](size_t i, auto lanes) HWY_ATTR {
    const auto da = hn::Sub(Load(d, a + i, lanes), mean_a);
    const auto db = hn::Sub(Load(d, b + i, lanes), mean_b);
    auto step = hn::MulAdd(by_a, da, hn::Mul(by_b, db));
    if (w != nullptr) step = hn::Mul(step, Load(d, w + i, lanes));
    Store(d, hn::Add(Load(d, v + i, lanes), step), v + i, lanes);
  });
}

}  // namespace HWY_NAMESPACE
}  // namespace litags
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace litags {
namespace {

HWY_EXPORT(AddSums);
HWY_EXPORT(AddSlope);

constexpr int kStripRows = 16;

// A map whose variance is below this part of its mean square varies by less than float resolution:
// constant.
constexpr double kConstant = 1e-13;

struct Correlation {
  double loss = 1;     // 1 - PCC
  depth::Slope slope;  // of the loss; all zero if there is no correlation
};

Correlation Correlate(const depth::Sums& s, double weight) {
  Correlation result;
  if (!(s.w > 0)) return result;
  const double mean_a = s.a / s.w, mean_b = s.b / s.w;
  const double var_a = s.aa - s.a * mean_a, var_b = s.bb - s.b * mean_b;
  if (!(var_a > kConstant * s.aa) || !(var_b > kConstant * s.bb)) return result;
  const double scale = 1 / std::sqrt(var_a * var_b);
  const double pcc = (s.ab - s.a * mean_b) * scale;
  result.loss = 1 - pcc;
  result.slope.by_a = static_cast<float>(weight * pcc / var_a);
  result.slope.by_b = static_cast<float>(-weight * scale);
  result.slope.mean_a = static_cast<float>(mean_a);
  result.slope.mean_b = static_cast<float>(mean_b);
  return result;
}

constexpr size_t kSums = 6;  // of depth::Sums

void Add(const double* from, depth::Sums* to) {
  to->w += from[0], to->a += from[1], to->b += from[2];
  to->aa += from[3], to->bb += from[4], to->ab += from[5];
}

// The maps that are compared, and the regions: number 0 is the whole map, the others are patches.
struct Maps {
  PlanesView rendered, target, confidence;
  const std::vector<PixelRect>& patches;

  size_t regions() const { return patches.size() + 1; }
  PixelRect Region(size_t i) const {
    return i == 0 ? PixelRect{0, 0, rendered.width, rendered.height} : patches[i - 1];
  }
  size_t strips() const { return (rendered.height + kStripRows - 1) / kStripRows; }
  const float* ConfidenceAt(size_t at) const {
    return confidence.empty() ? nullptr : confidence.data + at;
  }
};

void CheckMaps(const Maps& maps, PlanesSpan v_rendered) {
  const int width = maps.rendered.width, height = maps.rendered.height;
  LITAGS_CHECK(maps.rendered.size() > 0 && maps.rendered.channels == 1);
  LITAGS_CHECK(SameSize(maps.target, maps.rendered));
  LITAGS_CHECK(maps.confidence.empty() || SameSize(maps.confidence, maps.rendered));
  LITAGS_CHECK(v_rendered.empty() || SameSize(v_rendered, maps.rendered));
  for (const PixelRect& p : maps.patches) {
    LITAGS_CHECK(p.x >= 0 && p.y >= 0 && p.width > 0 && p.height > 0);
    LITAGS_CHECK(p.x <= width - p.width && p.y <= height - p.height);
  }
}

// Writes the sums of every region and strip of rows to ws.partials, [region][strip][kSums].
void SumRegions(const Maps& maps, LossWorkspace& ws) {
  const size_t strips = maps.strips();
  ws.partials.assign(maps.regions() * strips * kSums, 0.0);
  const auto add_sums = HWY_DYNAMIC_DISPATCH(AddSums);
  ParallelFor(ws.threads, strips, [&](size_t strip, int) {
    const int first = static_cast<int>(strip) * kStripRows;
    const int last = std::min(maps.rendered.height, first + kStripRows);
    for (size_t i = 0; i < maps.regions(); ++i) {
      const PixelRect r = maps.Region(i);
      depth::Sums s;
      for (int y = std::max(first, r.y); y < std::min(last, r.y + r.height); ++y) {
        const size_t at = size_t(y) * maps.rendered.width + r.x;
        add_sums(maps.rendered.data + at, maps.target.data + at, maps.ConfidenceAt(at), r.width,
                 &s);
      }
      const std::array<double, kSums> values = {s.w, s.a, s.b, s.aa, s.bb, s.ab};
      std::copy(values.begin(), values.end(), &ws.partials[(i * strips + strip) * kSums]);
    }
  });
}

// Adds the gradients of all regions.
void AddSlopes(const Maps& maps, const std::vector<depth::Slope>& slopes, int threads,
               PlanesSpan v_rendered) {
  const auto add_slope = HWY_DYNAMIC_DISPATCH(AddSlope);
  ParallelFor(threads, maps.strips(), [&](size_t strip, int) {
    const int first = static_cast<int>(strip) * kStripRows;
    for (int y = first; y < std::min(maps.rendered.height, first + kStripRows); ++y) {
      for (size_t i = 0; i < maps.regions(); ++i) {
        const PixelRect r = maps.Region(i);
        if (y < r.y || y >= r.y + r.height) continue;
        const size_t at = size_t(y) * maps.rendered.width + r.x;
        add_slope(maps.rendered.data + at, maps.target.data + at, maps.ConfidenceAt(at), r.width,
                  slopes[i], v_rendered.data + at);
      }
    }
  });
}

}  // namespace

std::vector<PixelRect> DrawDepthPatches(int width, int height, uint64_t seed, uint64_t iteration) {
  constexpr int kSide = 128;         // px
  constexpr double kFraction = 0.5;  // of the cells of a grid of patches
  LITAGS_CHECK(width > 0 && height > 0);
  const int w = std::min(kSide, width), h = std::min(kSide, height);
  const int cells = (width / w) * (height / h);
  const int count = std::max(1, static_cast<int>(std::lround(kFraction * cells)));
  constexpr uint64_t kStream =
      0x64657074686c6f73;  // "depthlos": apart from other users of the seed
  const CounterRng rng(seed, kStream ^ iteration);
  std::vector<PixelRect> patches(count);
  for (int i = 0; i < count; ++i) {
    patches[i] = {static_cast<int>(rng.Below(2 * i, width - w + 1)),
                  static_cast<int>(rng.Below(2 * i + 1, height - h + 1)), w, h};
  }
  return patches;
}

DepthLossTerms DepthLoss(PlanesView rendered, PlanesView target, PlanesView confidence,
                         const std::vector<PixelRect>& patches, double weight,
                         PlanesSpan v_rendered, LossWorkspace& ws) {
  const Maps maps = {rendered, target, confidence, patches};
  CheckMaps(maps, v_rendered);
  SumRegions(maps, ws);

  DepthLossTerms terms;
  std::vector<depth::Slope> slopes(maps.regions());
  const size_t strips = maps.strips();
  for (size_t i = 0; i < slopes.size(); ++i) {
    depth::Sums s;
    for (size_t strip = 0; strip < strips; ++strip) {
      Add(&ws.partials[(i * strips + strip) * kSums], &s);
    }
    const double share = i == 0 ? 1.0 : 1.0 / patches.size();
    const Correlation correlation = Correlate(s, weight * share);
    (i == 0 ? terms.global : terms.local) += weight * (share * correlation.loss);
    slopes[i] = correlation.slope;
  }
  if (!v_rendered.empty()) AddSlopes(maps, slopes, ws.threads, v_rendered);
  return terms;
}

}  // namespace litags
#endif  // HWY_ONCE
