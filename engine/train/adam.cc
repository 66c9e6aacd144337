#include "engine/train/adam.h"

#include <cmath>

#include "engine/core/check.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/train/adam.cc"
#include "hwy/foreach_target.h"  // IWYU pragma: keep
#include "hwy/highway.h"

HWY_BEFORE_NAMESPACE();
namespace litags {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using D = hn::CappedTag<float, kSplatBlock>;

uint32_t UpdateBlock(const AdamStep& s, const float* HWY_RESTRICT grads, uint32_t visible,
                     float* HWY_RESTRICT params, float* HWY_RESTRICT m1, float* HWY_RESTRICT m2) {
  const D d;
  const hn::RebindToSigned<D> di;
  const size_t lanes = hn::Lanes(d);
  HWY_ALIGN int32_t bits[kSplatBlock];
  for (int i = 0; i < kSplatBlock; ++i) bits[i] = -static_cast<int32_t>((visible >> i) & 1);
  const auto b1 = hn::Set(d, s.constants.beta1), c1 = hn::Set(d, 1 - s.constants.beta1);
  const auto b2 = hn::Set(d, s.constants.beta2), c2 = hn::Set(d, 1 - s.constants.beta2);
  const auto zero = hn::Zero(d);
  uint32_t bad = 0;
  const auto inv_bias2 = hn::Set(d, s.inv_bias2), eps = hn::Set(d, s.constants.epsilon);
  for (size_t i = 0; i < kSplatBlock; i += lanes) {
    const auto mask = hn::RebindMask(d, hn::MaskFromVec(hn::Load(di, bits + i)));
    if (hn::AllFalse(d, mask)) continue;
    // Not finite once a moment or value was not: squares only add up, and 0 inf is NaN.
    auto probe = zero;
    for (int row = 0; row < s.rows; ++row) {
      const size_t at = row * kSplatBlock + i;
      const auto g = hn::Load(d, grads + at);
      const auto old1 = hn::Load(d, m1 + at), old2 = hn::Load(d, m2 + at),
                 old = hn::Load(d, params + at);
      const auto new1 = hn::MulAdd(b1, old1, hn::Mul(c1, g));
      const auto new2 = hn::MulAdd(b2, old2, hn::Mul(hn::Mul(c2, g), g));
      const auto scale = hn::Add(hn::Sqrt(hn::Mul(new2, inv_bias2)), eps);
      const auto step = hn::Div(hn::Mul(hn::Set(d, s.lr[row] * s.inv_bias1), new1), scale);
      hn::Store(hn::IfThenElse(mask, new1, old1), d, m1 + at);
      hn::Store(hn::IfThenElse(mask, new2, old2), d, m2 + at);
      const auto next = hn::Sub(old, step);
      hn::Store(hn::IfThenElse(mask, next, old), d, params + at);
      probe = hn::Add(probe, hn::MulAdd(zero, next, new2));
    }
    const auto lost = hn::AndNot(hn::IsFinite(probe), mask);
    if (hn::AllFalse(d, lost)) continue;
    hn::Store(hn::BitCast(di, hn::VecFromMask(d, lost)), di, bits + i);
    for (size_t k = i; k < i + lanes; ++k) bad |= static_cast<uint32_t>(bits[k] & 1) << k;
  }
  return bad;
}

}  // namespace HWY_NAMESPACE
}  // namespace litags
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace litags {

HWY_EXPORT(UpdateBlock);

AdamStep::AdamStep(int step, const AdamConstants& c)
    : constants(c),
      inv_bias1(static_cast<float>(1 / (1 - std::pow(double{c.beta1}, step)))),
      inv_bias2(static_cast<float>(1 / (1 - std::pow(double{c.beta2}, step)))) {}

uint32_t AdamUpdateBlock(const AdamStep& step, const float* grads, uint32_t visible, size_t block,
                         Splats* params, Splats* moment1, Splats* moment2) {
  return HWY_DYNAMIC_DISPATCH(UpdateBlock)(step, grads, visible, params->block(block),
                                           moment1->block(block), moment2->block(block));
}

bool AdamUpdate(const AdamStep& step, float lr, absl::Span<const float> grads,
                absl::Span<float> params, absl::Span<float> moment1, absl::Span<float> moment2) {
  LITAGS_CHECK(grads.size() == params.size() && params.size() == moment1.size() &&
               moment1.size() == moment2.size());
  const AdamConstants& c = step.constants;
  float probe = 0;  // as in UpdateBlock
  for (size_t i = 0; i < params.size(); ++i) {
    moment1[i] = c.beta1 * moment1[i] + (1 - c.beta1) * grads[i];
    moment2[i] = c.beta2 * moment2[i] + (1 - c.beta2) * grads[i] * grads[i];
    params[i] -=
        lr * step.inv_bias1 * moment1[i] / (std::sqrt(moment2[i] * step.inv_bias2) + c.epsilon);
    probe += 0 * moment2[i] + 0 * params[i];
  }
  return !std::isnan(probe);
}

}  // namespace litags
#endif  // HWY_ONCE
