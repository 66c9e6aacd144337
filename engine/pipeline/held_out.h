// Which photos are only evaluated (ReconstructOptions::holdout_every).
#ifndef LITAGS_ENGINE_PIPELINE_HELD_OUT_H_
#define LITAGS_ENGINE_PIPELINE_HELD_OUT_H_

#include <cstddef>
#include <cstdint>

namespace litags {

// With fewer photos there are none to spare.
inline int64_t LeastToHoldOut(int every) { return int64_t{2} * every; }

inline bool HoldsOut(size_t photos, int every) {
  return every > 0 && static_cast<int64_t>(photos) >= LeastToHoldOut(every);
}

// Of `photos` that a scene is made of, photo `i` by name.
inline bool IsHeldOut(size_t i, size_t photos, int every) {
  return HoldsOut(photos, every) &&
         i % static_cast<size_t>(every) == static_cast<size_t>(every) / 2;
}

}  // namespace litags

#endif  // LITAGS_ENGINE_PIPELINE_HELD_OUT_H_
