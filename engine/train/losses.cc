#include "engine/train/losses.h"

#include <algorithm>

#include "absl/functional/function_ref.h"
#include "engine/core/check.h"
#include "engine/core/parallel.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/train/losses.cc"
#include "hwy/foreach_target.h"  // IWYU pragma: keep
// After foreach_target.
#include "engine/core/simd-inl.h"

HWY_BEFORE_NAMESPACE();
namespace litags {
namespace HWY_NAMESPACE {

// Sums of n <= kTaskSamples floats keep a relative error near 1e-6 in lanes; totals are double.

// Sum of w |x - y|; v += gradient * w * sign(x - y). w and v may be null.
double L1Kernel(const float* x, const float* y, const float* w, size_t n, float gradient,
                float* v) {
  const FloatTag d;
  const auto g = hn::Set(d, gradient);
  auto sum = hn::Zero(d);
  ForVectors(n, [&](size_t i, auto lanes) HWY_ATTR {
    const auto diff = hn::Sub(Load(d, x + i, lanes), Load(d, y + i, lanes));
    const auto weight = w == nullptr ? hn::Set(d, 1.0f) : Load(d, w + i, lanes);
    sum = hn::MulAdd(weight, hn::Abs(diff), sum);
    if (v == nullptr) return;
    const auto step = hn::Mul(hn::Mul(g, weight), Sign(d, diff));
    Store(d, hn::Add(Load(d, v + i, lanes), step), v + i, lanes);
  });
  return Sum(d, sum);
}

// Sum of (x - y)^2; v_x += gradient * (x - y), v_y -= the same. v_x and v_y may be null.
double MseKernel(const float* x, const float* y, size_t n, float gradient, float* v_x, float* v_y) {
  const FloatTag d;
  const auto g = hn::Set(d, gradient);
  auto sum = hn::Zero(d);
  ForVectors(n, [&](size_t i, auto lanes) HWY_ATTR {
    const auto diff = hn::Sub(Load(d, x + i, lanes), Load(d, y + i, lanes));
    sum = hn::MulAdd(diff, diff, sum);
    const auto step = hn::Mul(g, diff);
    if (v_x != nullptr) Store(d, hn::Add(Load(d, v_x + i, lanes), step), v_x + i, lanes);
    if (v_y != nullptr) Store(d, hn::Sub(Load(d, v_y + i, lanes), step), v_y + i, lanes);
  });
  return Sum(d, sum);
}

// One row of total variation. `up` and `down` are the neighbouring rows, or `row` itself at the
// image's edge. Adds the sums of the differences to the right and down; v gets the derivative of
// gradient_x * sum_x + gradient_y * sum_y over all rows, as seen from this one.
template <bool kSquared>
void TvRow(const float* up, const float* row, const float* down, int width, float gradient_x,
           float gradient_y, float* v, double* sum_x, double* sum_y) {
  const FloatTag d;
  const auto gx = hn::Set(d, kSquared ? 2 * gradient_x : gradient_x);
  const auto gy = hn::Set(d, kSquared ? 2 * gradient_y : gradient_y);
  const auto cost = [](FloatVec diff)
                        HWY_ATTR { return kSquared ? hn::Mul(diff, diff) : hn::Abs(diff); };
  const auto slope = [&d](FloatVec diff) HWY_ATTR { return kSquared ? diff : Sign(d, diff); };
  auto total_x = hn::Zero(d), total_y = hn::Zero(d);
  // left and right are the pixel itself where the image ends.
  const auto pixels = [&](const float* left, const float* right, int x, auto lanes) HWY_ATTR {
    const auto center = Load(d, row + x, lanes);
    const auto to_right = hn::Sub(Load(d, right, lanes), center);
    const auto to_down = hn::Sub(Load(d, down + x, lanes), center);
    total_x = hn::Add(total_x, cost(to_right));
    total_y = hn::Add(total_y, cost(to_down));
    if (v == nullptr) return;
    const auto from_left = hn::Sub(center, Load(d, left, lanes));
    const auto from_up = hn::Sub(center, Load(d, up + x, lanes));
    const auto step_x = hn::Sub(slope(from_left), slope(to_right));
    const auto step_y = hn::Sub(slope(from_up), slope(to_down));
    const auto step = hn::MulAdd(gx, step_x, hn::Mul(gy, step_y));
    Store(d, hn::Add(Load(d, v + x, lanes), step), v + x, lanes);
  };
  pixels(row, row + (width > 1), 0, size_t{1});
  if (width > 1) {
    ForVectors(width - 2, [&](size_t i, auto lanes) HWY_ATTR {
      pixels(row + i, row + i + 2, static_cast<int>(i) + 1, lanes);
    });
    pixels(row + width - 2, row + width - 1, width - 1, size_t{1});
  }
  *sum_x += Sum(d, total_x);
  *sum_y += Sum(d, total_y);
}

void TvSquaredRow(const float* up, const float* row, const float* down, int width, float gradient_x,
                  float gradient_y, float* v, double* sum_x, double* sum_y) {
  TvRow<true>(up, row, down, width, gradient_x, gradient_y, v, sum_x, sum_y);
}

void TvAbsoluteRow(const float* up, const float* row, const float* down, int width,
                   float gradient_x, float gradient_y, float* v, double* sum_x, double* sum_y) {
  TvRow<false>(up, row, down, width, gradient_x, gradient_y, v, sum_x, sum_y);
}

}  // namespace HWY_NAMESPACE
}  // namespace litags
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace litags {
namespace {

HWY_EXPORT(L1Kernel);
HWY_EXPORT(MseKernel);
HWY_EXPORT(TvSquaredRow);
HWY_EXPORT(TvAbsoluteRow);

// Samples per task: small enough for float sums, large enough to hide the cost of a task.
constexpr size_t kTaskSamples = 8192;

// body(first, count) over [0, n) in pieces of kTaskSamples; the sum of its results in their order.
double SumOverSamples(size_t n, LossWorkspace& ws,
                      absl::FunctionRef<double(size_t first, size_t count)> body) {
  const size_t tasks = (n + kTaskSamples - 1) / kTaskSamples;
  ws.partials.assign(tasks, 0.0);
  ParallelFor(ws.threads, tasks, [&](size_t task, int) {
    const size_t first = task * kTaskSamples;
    ws.partials[task] = body(first, std::min(kTaskSamples, n - first));
  });
  double sum = 0;
  for (const double partial : ws.partials) sum += partial;
  return sum;
}

}  // namespace

void UnpackImage(const Photo& image, LossWorkspace& ws, Planes* planes) {
  planes->Reshape(3, image.height, image.width);
  const size_t n = planes->plane_size();
  ParallelFor(ws.threads, (n + kTaskSamples - 1) / kTaskSamples, [&](size_t task, int) {
    const size_t first = task * kTaskSamples, end = std::min(n, first + kTaskSamples);
    const int16_t* in = image.data.data();
    float* out[3] = {planes->plane(0), planes->plane(1), planes->plane(2)};
    for (size_t i = first; i < end; ++i) {
      for (int c = 0; c < 3; ++c) out[c][i] = EncodedOf(in[3 * i + c]);
    }
  });
}

void UnpackPlane(const PlaneU8& bytes, float scale, LossWorkspace& ws, Planes* plane) {
  plane->Reshape(1, bytes.height, bytes.width);
  const size_t n = plane->plane_size();
  ParallelFor(ws.threads, (n + kTaskSamples - 1) / kTaskSamples, [&](size_t task, int) {
    const size_t first = task * kTaskSamples, end = std::min(n, first + kTaskSamples);
    const uint8_t* in = bytes.data.data();
    float* out = plane->data.data();
    for (size_t i = first; i < end; ++i) out[i] = in[i] * scale;
  });
}

double L1Loss(PlanesView x, PlanesView y, double weight, PlanesSpan v_x, LossWorkspace& ws,
              PlanesView pixel_weights) {
  LITAGS_CHECK(SameSize(x, y) && x.size() > 0);
  LITAGS_CHECK(v_x.empty() || SameSize(x, v_x));
  const float gradient = static_cast<float>(weight / x.size());
  const auto kernel = HWY_DYNAMIC_DISPATCH(L1Kernel);
  if (pixel_weights.empty()) {
    const double sum = SumOverSamples(x.size(), ws, [&](size_t i, size_t n) {
      return kernel(x.data + i, y.data + i, nullptr, n, gradient,
                    v_x.empty() ? nullptr : v_x.data + i);
    });
    return weight * (sum / x.size());
  }
  LITAGS_CHECK(pixel_weights.channels == 1 && pixel_weights.plane_size() == x.plane_size());
  double sum = 0;
  for (int c = 0; c < x.channels; ++c) {
    sum += SumOverSamples(x.plane_size(), ws, [&](size_t i, size_t n) {
      return kernel(x.plane(c) + i, y.plane(c) + i, pixel_weights.data + i, n, gradient,
                    v_x.empty() ? nullptr : v_x.plane(c) + i);
    });
  }
  return weight * (sum / x.size());
}

double MseLoss(PlanesView x, PlanesView y, double weight, PlanesSpan v_x, PlanesSpan v_y,
               LossWorkspace& ws) {
  LITAGS_CHECK(SameSize(x, y) && x.size() > 0);
  LITAGS_CHECK(v_x.empty() || SameSize(x, v_x));
  LITAGS_CHECK(v_y.empty() || SameSize(y, v_y));
  const float gradient = static_cast<float>(2 * weight / x.size());
  const auto kernel = HWY_DYNAMIC_DISPATCH(MseKernel);
  const double sum = SumOverSamples(x.size(), ws, [&](size_t i, size_t n) {
    return kernel(x.data + i, y.data + i, n, gradient, v_x.empty() ? nullptr : v_x.data + i,
                  v_y.empty() ? nullptr : v_y.data + i);
  });
  return weight * (sum / x.size());
}

double TvLoss(PlanesView x, TvNorm norm, double weight, PlanesSpan v_x, LossWorkspace& ws) {
  LITAGS_CHECK(x.size() > 0 && (v_x.empty() || SameSize(x, v_x)));
  // An image one pixel wide or high has no differences that way.
  const double per_x = x.width > 1 ? 1.0 / (double(x.channels) * x.height * (x.width - 1)) : 0;
  const double per_y = x.height > 1 ? 1.0 / (double(x.channels) * (x.height - 1) * x.width) : 0;
  const float gradient_x = static_cast<float>(weight * per_x);
  const float gradient_y = static_cast<float>(weight * per_y);
  const auto kernel = norm == TvNorm::kSquared ? HWY_DYNAMIC_DISPATCH(TvSquaredRow)
                                               : HWY_DYNAMIC_DISPATCH(TvAbsoluteRow);
  constexpr int kTaskRows = 16;
  const int rows = x.channels * x.height;
  const size_t tasks = (rows + kTaskRows - 1) / kTaskRows;
  ws.partials.assign(2 * tasks, 0.0);
  ParallelFor(ws.threads, tasks, [&](size_t task, int) {
    const int first = static_cast<int>(task) * kTaskRows;
    for (int r = first; r < std::min(rows, first + kTaskRows); ++r) {
      const float* row = x.data + size_t(r) * x.width;
      const int y = r % x.height;
      kernel(y > 0 ? row - x.width : row, row, y + 1 < x.height ? row + x.width : row, x.width,
             gradient_x, gradient_y, v_x.empty() ? nullptr : v_x.data + size_t(r) * x.width,
             &ws.partials[2 * task], &ws.partials[2 * task + 1]);
    }
  });
  double sum_x = 0, sum_y = 0;
  for (size_t task = 0; task < tasks; ++task) {
    sum_x += ws.partials[2 * task];
    sum_y += ws.partials[2 * task + 1];
  }
  return weight * (sum_x * per_x + sum_y * per_y);
}

}  // namespace litags
#endif  // HWY_ONCE
