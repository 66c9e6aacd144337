// Colours of points from the photos that see them.
#ifndef LITAGS_ENGINE_SFM_POINT_COLORS_H_
#define LITAGS_ENGINE_SFM_POINT_COLORS_H_

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "engine/core/cancel.h"
#include "engine/io/sparse_model.h"

namespace litags {

// Sets every point's rgb to the mean, over its track, of what the pictures show there, between
// pixels. `paths[i]` is the picture of view i, whose px the tracks are in. Does not depend on
// `threads`. Errors of ReadImage; CANCELLED.
absl::Status ColorPoints(const std::vector<std::string>& paths, int threads,
                         const CancelToken& cancel, std::vector<SparsePoint>& points);

}  // namespace litags

#endif  // LITAGS_ENGINE_SFM_POINT_COLORS_H_
