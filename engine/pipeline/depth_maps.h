// Where the depth maps of a capture come from, by the job's options.
#ifndef LITAGS_ENGINE_PIPELINE_DEPTH_MAPS_H_
#define LITAGS_ENGINE_PIPELINE_DEPTH_MAPS_H_

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/types/span.h"
#include "engine/core/cancel.h"
#include "engine/io/sparse_model.h"
#include "engine/pipeline/capture.h"
#include "engine/pipeline/engine.h"
#include "engine/train/train_view.h"

namespace litags {

inline constexpr int kFewViews = 32;  // evenly by name, for stereo that nobody asked for. Choice

// The points with the tracks of the training photos alone, as indices into Capture::train.
std::vector<SparsePoint> PointsOfTraining(absl::Span<const SparsePoint> points,
                                          absl::Span<const int> point_views);

// The same with the tracks of at most kFewViews photos: stereo gives no map to the others.
std::vector<SparsePoint> PointsOfFew(absl::Span<const SparsePoint> points,
                                     absl::Span<const int> point_views);

// The source that options.depth_source means for this input: kAuto becomes kMaps or kStereo.
DepthOrigin ResolveDepthOrigin(const ReconstructInput& input, const ReconstructOptions& options);

// Fills TrainView::depth of `views`, and depth_used and notes of `report`. `points` are of the
// capture's model, `point_views` as in Capture. Maps of stereo and of a network are kept in
// work_dir/depth.litags and taken from there if they were made from the same photos, cameras and
// points (`key`), so that a resumed run has the very same. INVALID_ARGUMENT
// (DEPTH_MAPS_MISSING, DEPTH_MODEL_MISSING) if the source has nothing to work with; errors of the
// source. Pixels that do not count by their photo's mask get no depth.
absl::Status AddDepthMaps(const ReconstructInput& input, const ReconstructOptions& options,
                          absl::Span<const SparsePoint> points, absl::Span<const int> point_views,
                          const std::string& key, const CancelToken& cancel,
                          const StageReport& progress, std::vector<TrainView>* views,
                          ReconstructReport* report);

}  // namespace litags

#endif  // LITAGS_ENGINE_PIPELINE_DEPTH_MAPS_H_
