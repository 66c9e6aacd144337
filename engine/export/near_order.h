#ifndef LITAGS_ENGINE_EXPORT_NEAR_ORDER_H_
#define LITAGS_ENGINE_EXPORT_NEAR_ORDER_H_

#include <cstdint>
#include <vector>

#include "engine/core/splats.h"

namespace litags {

// An order in which neighbours in space follow each other, however far away a few Gaussians are: a
// Morton curve through a box twice as wide as the one that holds 99 % of them along each axis.
std::vector<uint32_t> NearOrder(const Splats& splats);

}  // namespace litags

#endif  // LITAGS_ENGINE_EXPORT_NEAR_ORDER_H_
