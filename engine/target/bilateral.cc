#include "engine/target/bilateral.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "engine/core/mask.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/target/bilateral.cc"
#include "hwy/foreach_target.h"  // IWYU pragma: keep
// After foreach_target.
#include "hwy/highway.h"

#ifndef LITAGS_ENGINE_TARGET_BILATERAL_ONCE_
#define LITAGS_ENGINE_TARGET_BILATERAL_ONCE_
namespace litags {

constexpr size_t kMostLanes = 16;  // rows are padded to whole vectors of any target
constexpr int kTapsAcross = 2 * kBilateralTaps + 1;

// One row: where its first pixel is in the padded planes.
struct BilateralRow {
  const float* image[3];
  const float* guide[3];
  const float* counts;  // null: all pixels count
  ptrdiff_t stride;     // of the planes
  int width;
  float per_range;
  const float* weights;  // [kTapsAcross], by distance along one axis
  float* means[3];
};

}  // namespace litags
#endif  // LITAGS_ENGINE_TARGET_BILATERAL_ONCE_

HWY_BEFORE_NAMESPACE();
namespace litags {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// Without fused operations, so that every instruction set gives the definition's bytes, which a
// test compares. Targets may differ all the same: what is done before and after is not held to it.
void FilterRow(const BilateralRow& r) {
  const HWY_CAPPED(float, kMostLanes) d;
  const auto zero = hn::Zero(d), one = hn::Set(d, 1.0f), per_range = hn::Set(d, r.per_range);
  for (int x = 0; x < r.width; x += static_cast<int>(hn::Lanes(d))) {
    const auto g0 = hn::LoadU(d, r.guide[0] + x), g1 = hn::LoadU(d, r.guide[1] + x),
               g2 = hn::LoadU(d, r.guide[2] + x);
    auto sum0 = zero, sum1 = zero, sum2 = zero, total = zero;
    for (int j = 0; j < kTapsAcross; ++j) {
      for (int i = 0; i < kTapsAcross; ++i) {
        const ptrdiff_t at = x + (j - kBilateralTaps) * kBilateralSpacing * r.stride +
                             (i - kBilateralTaps) * kBilateralSpacing;
        const auto d0 = hn::Sub(hn::LoadU(d, r.guide[0] + at), g0);
        const auto d1 = hn::Sub(hn::LoadU(d, r.guide[1] + at), g1);
        const auto d2 = hn::Sub(hn::LoadU(d, r.guide[2] + at), g2);
        const auto square = hn::Add(hn::Add(hn::Mul(d0, d0), hn::Mul(d1, d1)), hn::Mul(d2, d2));
        const auto near = hn::Max(zero, hn::Sub(one, hn::Mul(square, per_range)));
        auto weight = hn::Mul(hn::Mul(hn::Mul(near, near), near), hn::Set(d, r.weights[j]));
        weight = hn::Mul(weight, hn::Set(d, r.weights[i]));
        const bool middle = i == kBilateralTaps && j == kBilateralTaps;
        if (r.counts != nullptr && !middle) {
          weight = hn::Mul(weight, hn::LoadU(d, r.counts + at));
        }
        sum0 = hn::Add(sum0, hn::Mul(weight, hn::LoadU(d, r.image[0] + at)));
        sum1 = hn::Add(sum1, hn::Mul(weight, hn::LoadU(d, r.image[1] + at)));
        sum2 = hn::Add(sum2, hn::Mul(weight, hn::LoadU(d, r.image[2] + at)));
        total = hn::Add(total, weight);
      }
    }
    const auto share = hn::Div(one, total);  // the middle tap has a weight of 1
    hn::StoreU(hn::Mul(sum0, share), d, r.means[0] + x);
    hn::StoreU(hn::Mul(sum1, share), d, r.means[1] + x);
    hn::StoreU(hn::Mul(sum2, share), d, r.means[2] + x);
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace litags
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace litags {
namespace {

HWY_EXPORT(FilterRow);

// body(from, to): a pixel of the image for every one of the padded planes.
template <class Body>
void ForPadded(int width, int height, size_t stride, const Body& body) {
  for (int y = 0; y < height + 2 * kBilateralMargin; ++y) {
    const int v = std::clamp(y - kBilateralMargin, 0, height - 1);
    for (size_t x = 0; x < stride; ++x) {
      const int u = std::clamp(static_cast<int>(x) - kBilateralMargin, 0, width - 1);
      body(v, u, y * stride + x);
    }
  }
}

}  // namespace

BilateralFilter::BilateralFilter(const FloatImage& image, const FloatImage& guide,
                                 const PlaneU8& mask, float per_range)
    : width_(image.cols),
      height_(image.rows),
      stride_(width_ + 2 * kBilateralMargin + kMostLanes),
      per_range_(per_range) {
  for (int c = 0; c < 3; ++c) {
    image_[c] = Pad(image, c);
    guide_[c] = Pad(guide, c);
    row_[c].resize(stride_);
    means_[c] = row_[c].data();
  }
  if (!mask.empty()) counts_ = Pad(mask);
}

std::vector<float> BilateralFilter::Pad(const FloatImage& image, int channel) const {
  std::vector<float> padded(stride_ * (height_ + 2 * kBilateralMargin));
  ForPadded(width_, height_, stride_,
            [&](int v, int u, size_t at) { padded[at] = image(v, u)[channel]; });
  return padded;
}

std::vector<float> BilateralFilter::Pad(const PlaneU8& mask) const {
  std::vector<float> padded(stride_ * (height_ + 2 * kBilateralMargin));
  ForPadded(width_, height_, stride_,
            [&](int v, int u, size_t at) { padded[at] = Counts(mask, u, v) ? 1.0f : 0.0f; });
  return padded;
}

const std::array<const float*, 3>& BilateralFilter::Row(int y) {
  static const auto weights = [] {
    std::array<float, kTapsAcross> w;
    for (int i = 0; i < kTapsAcross; ++i) {
      const double distance = (i - kBilateralTaps) * kBilateralSpacing;
      w[i] = static_cast<float>(std::exp(-0.5 * std::pow(distance / kBilateralSigma, 2)));
    }
    return w;
  }();
  const size_t first = (y + kBilateralMargin) * stride_ + kBilateralMargin;
  BilateralRow row = {};
  row.counts = counts_.empty() ? nullptr : counts_.data() + first;
  row.stride = static_cast<ptrdiff_t>(stride_);
  row.width = width_;
  row.per_range = per_range_;
  row.weights = weights.data();
  for (int c = 0; c < 3; ++c) {
    row.image[c] = image_[c].data() + first;
    row.guide[c] = guide_[c].data() + first;
    row.means[c] = row_[c].data();
  }
  HWY_DYNAMIC_DISPATCH(FilterRow)(row);
  return means_;
}

}  // namespace litags
#endif  // HWY_ONCE
