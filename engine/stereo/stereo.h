// Depth without network weights: multi-view stereo on posed photos taken in bad light.
#ifndef LITAGS_ENGINE_STEREO_STEREO_H_
#define LITAGS_ENGINE_STEREO_STEREO_H_

#include <memory>
#include <optional>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/types/span.h"
#include "engine/core/cancel.h"
#include "engine/depth/depth_provider.h"
#include "engine/io/sparse_model.h"

namespace litags {

struct StereoOptions {
  int max_side = 320;  // px; photos are matched at this size at most, [32, 4096]. Choice
  int threads = 0;     // <= 0: all cores

  absl::Status Validate() const;
};

// Depth along the optical axis, in the units of the cameras, of every photo: [1, h, w] of the size
// it was matched at, with a confidence. `points[i].track[k].view` is an index into `photos`; sparse
// points give neighbours, depth range and guidance. nullopt for photos that share too few points
// with others, and those where nothing fits. The same bytes for any number of threads.
// `progress(done, total)` comes from the calling thread. INVALID_ARGUMENT for bad options,
// CANCELLED on request.
absl::StatusOr<std::vector<std::optional<DepthMap>>> StereoDepth(
    absl::Span<const PosedPhoto> photos, absl::Span<const SparsePoint> points,
    const StereoOptions& options, const CancelToken& cancel, DepthProgress progress);

// The same as a provider. Keeps `points`.
std::unique_ptr<DepthProvider> MakeStereoDepthProvider(std::vector<SparsePoint> points,
                                                       const StereoOptions& options);

}  // namespace litags

#endif  // LITAGS_ENGINE_STEREO_STEREO_H_
