#include <algorithm>
#include <cmath>

#include "engine/train/growth.h"

namespace litags {
namespace {

constexpr double kShrink = 1.6;   // scales of both are divided by this; 3DGS
constexpr uint64_t kNumbers = 8;  // random ones that a Gaussian may take

class CloneSplit : public GrowthStrategy {
 public:
  explicit CloneSplit(double clone_scale) : clone_scale_(clone_scale) {}

  Grown Grow(const Splats& parents, size_t p, size_t i, size_t twin, const CounterRng& rng,
             Splats* splats) const override {
    const float largest = std::exp(std::max(
        {parents.at(p, kLogScale), parents.at(p, kLogScale + 1), parents.at(p, kLogScale + 2)}));
    if (largest <= clone_scale_) return Grown::kCloned;
    Place(parents, p, rng, kNumbers * i, i, splats);
    Place(parents, p, rng, kNumbers * i + 3, twin, splats);
    return Grown::kSplit;
  }

 private:
  // Makes Gaussian i, a copy of Gaussian p of `parent`, a smaller one at a random place inside it.
  static void Place(const Splats& parent, size_t p, const CounterRng& rng, uint64_t counter,
                    size_t i, Splats* out) {
    MoveAlongAxes({rng.Normal(counter), rng.Normal(counter + 1), rng.Normal(counter + 2)}, parent,
                  p, i, out);
    for (int k = 0; k < 3; ++k) {
      out->at(i, kLogScale + k) -= static_cast<float>(std::log(kShrink));
    }
  }

  double clone_scale_;
};

}  // namespace

std::unique_ptr<GrowthStrategy> MakeCloneSplit(double clone_scale) {
  return std::make_unique<CloneSplit>(clone_scale);
}

}  // namespace litags
