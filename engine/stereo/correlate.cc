#include "engine/stereo/correlate.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/stereo/correlate.cc"
#include "hwy/foreach_target.h"  // IWYU pragma: keep
// After foreach_target.
#include "engine/core/simd-inl.h"

HWY_BEFORE_NAMESPACE();
namespace litags {
namespace HWY_NAMESPACE {

// Rows of scratch are whole vectors of any target.
size_t Padded(size_t n) { return (n + 15) / 16 * 16; }

// One row of the source as the reference would see it: `warped` where the surface projects to
// (bilinear, the border repeated), `seen` 1 or 0.
void WarpRow(const MatchImage& source, const Transfer& t, int y, int width,
             const float* inverse_depth, float* warped, float* seen) {
  const FloatTag d;
  const hn::RebindToSigned<FloatTag> di;
  const int stride = source.gray.width;
  const float* gray = source.gray.data.data();
  const auto max_x = hn::Set(d, static_cast<float>(source.gray.width - 1));
  const auto max_y = hn::Set(d, static_cast<float>(source.gray.height - 1));
  const auto last_x = hn::Set(di, source.gray.width - 2);
  const auto last_y = hn::Set(di, source.gray.height - 2);
  const auto one = hn::Set(d, 1.0f), half = hn::Set(d, 0.5f), zero = hn::Zero(d);
  const float v = y + 0.5f;
  const auto base_x = hn::Set(d, t.ray[1] * v + t.ray[2]);
  const auto base_y = hn::Set(d, t.ray[4] * v + t.ray[5]);
  const auto base_z = hn::Set(d, t.ray[7] * v + t.ray[8]);
  for (int x = 0; x < width; x += static_cast<int>(hn::Lanes(d))) {
    const auto u = hn::Add(hn::Iota(d, static_cast<float>(x)), half);
    const auto w = hn::LoadU(d, inverse_depth + x);
    const auto project = [&](int row, FloatVec base) HWY_ATTR {
      return hn::MulAdd(hn::Set(d, t.ray[3 * row]), u,
                        hn::MulAdd(hn::Set(d, t.shift[row]), w, base));
    };
    const auto qz = project(2, base_z);
    const auto in_front = hn::Gt(qz, hn::Set(d, 1e-6f));
    const auto scale = hn::Div(one, hn::IfThenElse(in_front, qz, one));
    const auto px = hn::Sub(hn::Mul(project(0, base_x), scale), half);
    const auto py = hn::Sub(hn::Mul(project(1, base_y), scale), half);
    const auto inside = hn::And(hn::And(hn::Ge(px, zero), hn::Le(px, max_x)),
                                hn::And(hn::Ge(py, zero), hn::Le(py, max_y)));
    hn::StoreU(hn::IfThenElseZero(hn::And(in_front, inside), one), d, seen + x);
    // Min and Max in this order make a NaN the border.
    const auto cx = hn::Min(hn::Max(px, zero), max_x), cy = hn::Min(hn::Max(py, zero), max_y);
    const auto ix = hn::Min(hn::ConvertTo(di, cx), last_x);
    const auto iy = hn::Min(hn::ConvertTo(di, cy), last_y);
    const auto fx = hn::Sub(cx, hn::ConvertTo(d, ix)), fy = hn::Sub(cy, hn::ConvertTo(d, iy));
    const auto at = hn::Add(hn::Mul(iy, hn::Set(di, stride)), ix);
    const auto g00 = hn::GatherIndex(d, gray, at), g01 = hn::GatherIndex(d, gray + 1, at);
    const auto g10 = hn::GatherIndex(d, gray + stride, at);
    const auto g11 = hn::GatherIndex(d, gray + stride + 1, at);
    const auto top = hn::MulAdd(fx, hn::Sub(g01, g00), g00);
    const auto bottom = hn::MulAdd(fx, hn::Sub(g11, g10), g10);
    hn::StoreU(hn::MulAdd(fy, hn::Sub(bottom, top), top), d, warped + x);
  }
}

// Repeats the ends of row[0, width) into `radius` places before and up to whole vectors behind.
void Extend(float* row, int width, int radius, size_t padded) {
  std::fill(row - radius, row, row[0]);
  std::fill(row + width, row + padded + radius, row[width - 1]);
}

// Sums of 2 radius + 1 neighbours along a row: of w, w w and w r.
void SumRow(const float* w, const float* r, size_t padded, int radius, float* sums) {
  const FloatTag d;
  for (size_t x = 0; x < padded; x += hn::Lanes(d)) {
    auto sw = hn::Zero(d), sww = sw, swr = sw;
    for (int k = -radius; k <= radius; ++k) {
      const auto vw = hn::LoadU(d, w + x + k), vr = hn::LoadU(d, r + x + k);
      sw = hn::Add(sw, vw);
      sww = hn::MulAdd(vw, vw, sww);
      swr = hn::MulAdd(vw, vr, swr);
    }
    hn::StoreU(sw, d, sums + x);
    hn::StoreU(sww, d, sums + padded + x);
    hn::StoreU(swr, d, sums + 2 * padded + x);
  }
}

// Adds the sums of 2 radius + 1 rows and turns them into the correlation of one row.
void CorrelateRow(const float* const* rows, const float* seen, const CorrelationReference& ref,
                  float noise2, size_t at, int width, size_t padded, float* zncc) {
  const FloatTag d;
  const int side = 2 * ref.radius + 1;
  const auto share = hn::Set(d, 1.0f / (side * side));
  const auto floor = hn::Set(d, noise2);
  for (int x = 0; x < width; x += static_cast<int>(hn::Lanes(d))) {
    auto sw = hn::Zero(d), sww = sw, swr = sw;
    for (int k = 0; k < side; ++k) {
      sw = hn::Add(sw, hn::LoadU(d, rows[k] + x));
      sww = hn::Add(sww, hn::LoadU(d, rows[k] + padded + x));
      swr = hn::Add(swr, hn::LoadU(d, rows[k] + 2 * padded + x));
    }
    const auto mean_w = hn::Mul(sw, share);
    const auto variance = hn::Max(hn::NegMulAdd(mean_w, mean_w, hn::Mul(sww, share)), hn::Zero(d));
    const auto covariance =
        hn::NegMulAdd(mean_w, hn::LoadU(d, ref.mean.data() + at + x), hn::Mul(swr, share));
    const auto fit = hn::Div(hn::Mul(covariance, hn::LoadU(d, ref.deviation.data() + at + x)),
                             hn::Sqrt(hn::Add(variance, floor)));
    const auto result = hn::Mul(fit, hn::LoadU(d, seen + x));
    if (x + static_cast<int>(hn::Lanes(d)) <= width) {
      Store(d, result, zncc + x, AllLanes());
    } else {
      Store(d, result, zncc + x, size_t(width - x));
    }
  }
}

void CorrelateImage(const CorrelationReference& ref, const MatchImage& source, float noise2,
                    const Transfer& t, const float* inverse_depth, std::vector<float>* scratch,
                    float* zncc) {
  const int width = ref.image->gray.width, height = ref.image->gray.height;
  const int radius = ref.radius, side = 2 * radius + 1;
  const size_t padded = Padded(width), line = padded + 2 * radius;
  // Rows: depth, warped, reference; then per row of the window its sums and what is seen.
  scratch->resize(3 * line + side * 4 * padded);
  float* depth_row = scratch->data();
  float* warped = scratch->data() + line + radius;
  float* own = scratch->data() + 2 * line + radius;
  float* ring = scratch->data() + 3 * line;
  const auto slot = [&](int y) { return ring + (y % side) * 4 * padded; };
  std::vector<const float*> rows(side);
  int next = 0;
  for (int y = 0; y < height; ++y) {
    for (; next <= std::min(height - 1, y + radius); ++next) {
      std::copy_n(inverse_depth + size_t(next) * width, width, depth_row);
      std::fill(depth_row + width, depth_row + padded, depth_row[width - 1]);
      WarpRow(source, t, next, width, depth_row, warped, slot(next) + 3 * padded);
      Extend(warped, width, radius, padded);
      std::copy_n(ref.image->gray.data.data() + size_t(next) * width, width, own);
      Extend(own, width, radius, padded);
      SumRow(warped, own, padded, radius, slot(next));
    }
    for (int k = 0; k < side; ++k) rows[k] = slot(std::clamp(y + k - radius, 0, height - 1));
    const size_t at = size_t(y) * width;
    CorrelateRow(rows.data(), slot(y) + 3 * padded, ref, noise2, at, width, padded, zncc + at);
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace litags
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace litags {
namespace {

HWY_EXPORT(CorrelateImage);

// What variances are increased by. Below the floor two pixels cannot be told apart by anything that
// a camera does; it keeps windows of one value from dividing by 0.
float NoiseVariance(const MatchImage& image) {
  constexpr float kLeastNoise = 1e-3f;
  return std::max(kLeastNoise * kLeastNoise, image.noise * image.noise);
}

}  // namespace

CorrelationReference::CorrelationReference(const MatchImage& image_in, int radius_in)
    : image(&image_in), radius(radius_in) {
  const int w = image->gray.width, h = image->gray.height;
  // Vectors may read past the last pixel, up to one of any target.
  mean.resize(size_t(w) * h + 16);
  deviation.resize(size_t(w) * h + 16);
  const float noise2 = NoiseVariance(*image);
  std::vector<double> sums(size_t(w) * h), squares(sums.size());
  const auto along = [](int i, int n) { return std::clamp(i, 0, n - 1); };
  for (int y = 0; y < h; ++y) {
    for (int x = 0; x < w; ++x) {
      for (int k = -radius; k <= radius; ++k) {
        const double v = image->gray.at(0, y, along(x + k, w));
        sums[size_t(y) * w + x] += v;
        squares[size_t(y) * w + x] += v * v;
      }
    }
  }
  const double share = 1.0 / ((2 * radius + 1) * (2 * radius + 1));
  for (int y = 0; y < h; ++y) {
    for (int x = 0; x < w; ++x) {
      double sum = 0, square = 0;
      for (int k = -radius; k <= radius; ++k) {
        sum += sums[size_t(along(y + k, h)) * w + x];
        square += squares[size_t(along(y + k, h)) * w + x];
      }
      const double m = sum * share, variance = std::max(0.0, square * share - m * m);
      mean[size_t(y) * w + x] = static_cast<float>(m);
      deviation[size_t(y) * w + x] = static_cast<float>(1 / std::sqrt(variance + noise2));
    }
  }
}

std::array<double, 3> Transfer::Project(double x, double y, double inverse_depth) const {
  std::array<double, 3> q;
  for (int i = 0; i < 3; ++i) {
    q[i] = ray[3 * i] * x + ray[3 * i + 1] * y + ray[3 * i + 2] + inverse_depth * shift[i];
  }
  return q;
}

Transfer::Transfer(const Camera& r, const Camera& s) {
  // x_s = R_s R_r^T (x_r - t_r) + t_s
  double rotation[9], translation[3];
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      rotation[3 * i + j] = 0;
      for (int k = 0; k < 3; ++k) rotation[3 * i + j] += s.R[3 * i + k] * r.R[3 * j + k];
    }
    translation[i] = s.t[i];
    for (int j = 0; j < 3; ++j) translation[i] -= rotation[3 * i + j] * r.t[j];
  }
  const double K[9] = {s.fx, 0, s.cx, 0, s.fy, s.cy, 0, 0, 1};
  for (int i = 0; i < 3; ++i) {
    double row[3] = {0, 0, 0}, moved = 0;
    for (int k = 0; k < 3; ++k) {
      for (int j = 0; j < 3; ++j) row[j] += K[3 * i + k] * rotation[3 * k + j];
      moved += K[3 * i + k] * translation[k];
    }
    ray[3 * i] = static_cast<float>(row[0] / r.fx);
    ray[3 * i + 1] = static_cast<float>(row[1] / r.fy);
    ray[3 * i + 2] = static_cast<float>(row[2] - row[0] * r.cx / r.fx - row[1] * r.cy / r.fy);
    shift[i] = static_cast<float>(moved);
  }
}

void Correlate(const CorrelationReference& reference, const MatchImage& source,
               const Transfer& transfer, const float* inverse_depth, std::vector<float>* scratch,
               float* zncc) {
  HWY_DYNAMIC_DISPATCH(CorrelateImage)
  (reference, source, NoiseVariance(source), transfer, inverse_depth, scratch, zncc);
}

}  // namespace litags
#endif  // HWY_ONCE
