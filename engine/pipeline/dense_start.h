// More Gaussians to start from than the sparse points: dark photos have few of those, and where
// there are few photos, too, density control takes long to grow the rest.
#ifndef LITAGS_ENGINE_PIPELINE_DENSE_START_H_
#define LITAGS_ENGINE_PIPELINE_DENSE_START_H_

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "absl/types/span.h"
#include "engine/io/sparse_model.h"
#include "engine/pipeline/context.h"
#include "engine/pipeline/depth_maps.h"

namespace litags {

inline constexpr double kDenseConfidence = 0.5;  // least, of depth. Choice

// A photo and its depth, in the units of the cameras and with a confidence.
struct PhotoDepth {
  const PosedPhoto* photo;
  const DepthMap* map;
};

// World points, without tracks, of a square grid of pixels of all maps: where depth has
// kDenseConfidence and the photo's pixel counts by its mask. As many as the finest grid of whole
// pixels has without exceeding `limit`. Colours are the pseudo-targets'.
std::vector<SparsePoint> PointsOfDepth(absl::Span<const PhotoDepth> photos, int64_t limit);

// Points of stereo depth to start from besides the sparse `points`, none unless recipe.dense_start:
// with these at most a sixteenth of max_gaussians, the budget of photos at a quarter of their
// size. They are kept in work_dir/start.litags and taken from there if they were made from the same
// photos, cameras and points (`key`). Errors are those of stereo and of writing that file. What is
// found, or that nothing is, becomes a note.
absl::StatusOr<std::vector<SparsePoint>> DenseStartPoints(const Context& context,
                                                          const std::vector<PosedPhoto>& photos,
                                                          const DepthMaps& depth,
                                                          absl::Span<const SparsePoint> points,
                                                          absl::Span<const int> point_views,
                                                          const std::string& key);

}  // namespace litags

#endif  // LITAGS_ENGINE_PIPELINE_DENSE_START_H_
