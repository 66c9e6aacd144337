#include <algorithm>
#include <cmath>

#include "engine/core/splats.h"
#include "engine/train/growth.h"

namespace litags {
namespace {

// Halves, relative to the whole. Their length and offset along the longest axis keep its variance
// there, 1/4 + 3/4. Choice
constexpr double kLength = 0.5, kOffset = 0.8660254;
constexpr double kWidth = 0.9;    // of the other axes. Choice
constexpr double kOpacity = 0.8;  // where halves overlap they cover more. Choice

class LongAxis : public GrowthStrategy {
 public:
  Grown Grow(const Splats& parents, size_t p, size_t i, size_t twin, const CounterRng&,
             Splats* splats) const override {
    Place(parents, p, 1, i, splats);
    Place(parents, p, -1, twin, splats);
    return Grown::kSplit;
  }

 private:
  // Makes Gaussian i, a copy of Gaussian p of `parent`, its half on one side (1 or -1) of the
  // middle.
  static void Place(const Splats& parent, size_t p, double side, size_t i, Splats* out) {
    const float scales[3] = {parent.at(p, kLogScale), parent.at(p, kLogScale + 1),
                             parent.at(p, kLogScale + 2)};
    const auto longest = std::max_element(scales, scales + 3) - scales;
    std::array<double, 3> offset = {};
    offset[longest] = side * kOffset;
    MoveAlongAxes(offset, parent, p, i, out);
    for (int k = 0; k < 3; ++k) {
      out->at(i, kLogScale + k) += static_cast<float>(std::log(k == longest ? kLength : kWidth));
    }
    out->at(i, kLogitOpacity) = LogitOf(kOpacity * Opacity(parent, p));
  }
};

}  // namespace

std::unique_ptr<GrowthStrategy> MakeLongAxis() { return std::make_unique<LongAxis>(); }

}  // namespace litags
