// The scalar twin of descriptor_match.h, for tests.
#ifndef LITAGS_ENGINE_SFM_SCALAR_MATCH_H_
#define LITAGS_ENGINE_SFM_SCALAR_MATCH_H_

#include <cstddef>
#include <cstdint>
#include <vector>

#include "engine/sfm/descriptor_match.h"

namespace litags {

using Descriptors = std::vector<uint8_t>;  // [n, 128]

int32_t Product(const Descriptors& a, size_t i, const Descriptors& b, size_t j);

// Of each of `of`; in a tie the index is the first of the best.
NearestProducts ScalarNearest(const Descriptors& of, const Descriptors& in, int32_t floor);

// COLMAP's rule word by word.
std::vector<FeatureMatch> ScalarMatches(const Descriptors& a, const Descriptors& b,
                                        const MatchRule& rule);

}  // namespace litags

#endif  // LITAGS_ENGINE_SFM_SCALAR_MATCH_H_
