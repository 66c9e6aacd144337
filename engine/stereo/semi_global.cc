#include "engine/stereo/semi_global.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "engine/core/check.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/stereo/semi_global.cc"
#include "hwy/foreach_target.h"  // IWYU pragma: keep
// After foreach_target.
#include "hwy/highway.h"

HWY_BEFORE_NAMESPACE();
namespace litags {
namespace HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

// L(d) = C(d) + min(L'(d), L'(d +- 1) + step, least' + jump) - least', where ' is the pixel before
// on the path. `before` and `path` have one more label at either end, of cost 0x7FFF. Adds L to
// `sum` and returns its minimum.
uint16_t StepPath(const uint8_t* cost, const uint16_t* before, uint16_t least_before, int step,
                  int jump, int labels, uint16_t* path, uint16_t* sum) {
  const HWY_CAPPED(uint16_t, 16) d;
  const hn::Rebind<uint8_t, decltype(d)> bytes;
  const auto vstep = hn::Set(d, static_cast<uint16_t>(step));
  const auto least = hn::Set(d, least_before);
  const auto far = hn::Set(d, static_cast<uint16_t>(least_before + jump));
  auto best = hn::Set(d, uint16_t{0xFFFF});
  for (int i = 0; i < labels; i += static_cast<int>(hn::Lanes(d))) {
    const auto same = hn::LoadU(d, before + i);
    const auto side = hn::Min(hn::LoadU(d, before + i - 1), hn::LoadU(d, before + i + 1));
    const auto from = hn::Min(hn::Min(same, hn::Add(side, vstep)), far);
    const auto value = hn::Add(hn::PromoteTo(d, hn::LoadU(bytes, cost + i)), hn::Sub(from, least));
    hn::StoreU(value, d, path + i);
    hn::StoreU(hn::Add(hn::LoadU(d, sum + i), value), d, sum + i);
    best = hn::Min(best, value);
  }
  return hn::GetLane(hn::MinOfLanes(d, best));
}

// One direction: the path comes from (x - dx, y - dy).
void AggregateDirection(const CostVolume& volume, const float* gray,
                        const SmoothnessPenalty& penalty, int dx, int dy, uint16_t* sums) {
  const int width = volume.width, height = volume.height, labels = volume.labels;
  const size_t line = labels + 2;
  constexpr uint16_t kNever = 0x7FFF;
  const std::vector<uint16_t> start(line, 0);  // no pixel before: no penalty
  std::vector<uint16_t> rows[2];
  std::vector<uint16_t> least[2];
  for (int i = 0; i < 2; ++i) {
    rows[i].assign(width * line, kNever);
    least[i].assign(width, 0);
  }
  const float contrast = static_cast<float>(std::max(penalty.edge_contrast, 1e-9));
  for (int j = 0; j < height; ++j) {
    const int y = dy < 0 ? height - 1 - j : j;
    const int now = j % 2, last = dy == 0 ? now : 1 - now;
    for (int i = 0; i < width; ++i) {
      const int x = dx < 0 ? width - 1 - i : i;
      const size_t pixel = size_t(y) * width + x;
      const int bx = x - dx, by = y - dy;
      const bool first = bx < 0 || bx >= width || by < 0 || by >= height;
      const float edge = first ? 0 : std::abs(gray[pixel] - gray[size_t(by) * width + bx]);
      const int jump =
          std::max(penalty.step, static_cast<int>(penalty.jump * contrast / (contrast + edge)));
      least[now][x] = StepPath(volume.cost.data() + pixel * labels,
                               first ? start.data() + 1 : &rows[last][bx * line + 1],
                               first ? 0 : least[last][bx], penalty.step, jump, labels,
                               &rows[now][x * line + 1], sums + pixel * labels);
    }
  }
}

}  // namespace HWY_NAMESPACE
}  // namespace litags
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace litags {
namespace {

HWY_EXPORT(AggregateDirection);

}  // namespace

std::vector<uint16_t> AggregateCosts(const CostVolume& volume, const float* gray,
                                     const SmoothnessPenalty& penalty) {
  // A path cost is at most 255 + jump; eight of them fit 16 bits, and so does one and the sentinel.
  LITAGS_CHECK(penalty.step >= 0 && penalty.jump >= penalty.step && penalty.jump <= 2000);
  std::vector<uint16_t> sums(volume.cost.size(), 0);
  const auto aggregate = HWY_DYNAMIC_DISPATCH(AggregateDirection);
  for (int dy = -1; dy <= 1; ++dy) {
    for (int dx = -1; dx <= 1; ++dx) {
      if (dx != 0 || dy != 0) aggregate(volume, gray, penalty, dx, dy, sums.data());
    }
  }
  return sums;
}

}  // namespace litags
#endif  // HWY_ONCE
