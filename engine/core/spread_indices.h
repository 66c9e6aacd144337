// Which of many views are looked at where all would take too long.
#ifndef LITAGS_ENGINE_CORE_SPREAD_INDICES_H_
#define LITAGS_ENGINE_CORE_SPREAD_INDICES_H_

#include <cstddef>
#include <vector>

namespace litags {

// At most `most` of the indices 0 to count - 1, ascending and spread over all of them; all if there
// are no more. Views of a panorama or a rig repeat their directions with a period, and equal steps
// could meet one direction only. These steps have no period.
std::vector<size_t> SpreadIndices(size_t count, size_t most);

}  // namespace litags

#endif  // LITAGS_ENGINE_CORE_SPREAD_INDICES_H_
