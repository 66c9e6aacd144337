// NaN recovery: what a run that met a number that is not finite does when it repeats the iteration.
#ifndef LITAGS_ENGINE_TRAIN_NAN_RECOVERY_H_
#define LITAGS_ENGINE_TRAIN_NAN_RECOVERY_H_

#include <atomic>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <string>

#include "engine/core/image.h"
#include "engine/train/adam.h"
#include "engine/train/density.h"

namespace litags {

// An iteration that met a NaN or an infinity. A run that was rolled back repeats the iterations
// before it exactly, then does this one with care; where it was rolled back to changes nothing.
struct NanRecovery {
  int iteration = 0;
  // True: the gradient of some Gaussians was not finite; they become transparent, all others are
  // updated. False: anything else; the photo's turn is skipped.
  bool gaussians = false;
  std::string source;  // which quantity, photo and iteration, for a human
};

// More of them than this and the run gives up: what is wrong is not in single iterations.
constexpr size_t kMaxNanRecoveries = 8;

// The smallest index of those that several threads report.
class SmallestIndex {
 public:
  void Add(size_t index) {
    size_t seen = index_.load(std::memory_order_relaxed);
    while (index < seen && !index_.compare_exchange_weak(seen, index)) {
    }
  }
  bool any() const { return get() != std::numeric_limits<size_t>::max(); }
  size_t get() const { return index_.load(std::memory_order_relaxed); }

 private:
  std::atomic<size_t> index_ = std::numeric_limits<size_t>::max();
};

// AdamUpdateBlock on state->params and its moments. Gaussians that would not stay finite keep
// their values but become transparent; density control removes them while it runs.
void UpdateBlockOrHide(const AdamStep& step, const float* grads, uint32_t visible, size_t block,
                       SplatState* state);

// "scale of Gaussian 17": its first parameter with a value or moment that is not finite.
std::string NameOfNotFinite(const SplatState& state, size_t gaussian);

// "light in 12 px, first at (3, 4)": the first rendered channel with values that are not finite; ""
// if there is none. [3, 8 or 11, H, W] of a `crop` of the photo at 1 / `shrink` of its size; the
// place is the photo's.
std::string PixelsNotFinite(const Planes& channels, const PixelRect& crop, int shrink);

}  // namespace litags

#endif  // LITAGS_ENGINE_TRAIN_NAN_RECOVERY_H_
