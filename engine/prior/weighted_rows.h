// The inner loop of the prior's correlations.
#ifndef LITAGS_ENGINE_PRIOR_WEIGHTED_ROWS_H_
#define LITAGS_ENGINE_PRIOR_WEIGHTED_ROWS_H_

#include <cstddef>

#include "absl/types/span.h"

namespace litags {

// out[i] = sum over k of weights[k] rows[k][i], i in [0, n), added in the order of k: the same
// bytes on every instruction set. As many rows as weights; they may overlap each other, not `out`.
void SumWeightedRows(absl::Span<const float* const> rows, absl::Span<const float> weights, size_t n,
                     float* out);

}  // namespace litags

#endif  // LITAGS_ENGINE_PRIOR_WEIGHTED_ROWS_H_
