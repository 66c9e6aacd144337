#ifndef LITAGS_TESTS_FUZZ_CHECK_MODEL_H_
#define LITAGS_TESTS_FUZZ_CHECK_MODEL_H_

#include <cstddef>

#include "engine/core/check.h"
#include "engine/io/sparse_model.h"

namespace litags {

// What whoever uses a model that was read relies on.
inline void CheckModel(const SparseModel& model) {
  LITAGS_CHECK(model.distortions.size() == model.views.size());
  for (const SparsePoint& point : model.points) {
    for (const TrackElement& seen : point.track) {
      LITAGS_CHECK(seen.view >= 0 && static_cast<size_t>(seen.view) < model.views.size());
    }
  }
}

}  // namespace litags

#endif  // LITAGS_TESTS_FUZZ_CHECK_MODEL_H_
