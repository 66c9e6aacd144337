// How much main memory a reconstruction takes, known before it starts.
#ifndef LITAGS_ENGINE_PIPELINE_MEMORY_ESTIMATE_H_
#define LITAGS_ENGINE_PIPELINE_MEMORY_ESTIMATE_H_

#include <algorithm>
#include <cstdint>
#include <map>
#include <string>

#include "absl/status/status.h"
#include "absl/types/span.h"
#include "engine/pipeline/engine.h"
#include "engine/pipeline/options.h"
#include "engine/pipeline/photo_look.h"

namespace litags {

// Bytes at the peak. COLMAP's processes have ended by then.
struct MemoryEstimate {
  int64_t reading = 0;    // of photos, beside those read before: over when targets are made
  int64_t photos = 0;     // all of them with their targets, maps and smaller copies
  int64_t rims = 0;       // of masks of their rims, which undistortion may make
  int64_t work = 0;       // on photos: their targets, stereo, or rendering and its gradients
  int64_t gaussians = 0;  // with moments and what is made anew of them, max_gaussians of them

  int64_t Least() const { return std::max(reading, photos + work); }
  int64_t Most() const { return std::max(reading, photos + work + gaussians) + rims + kPrograms; }

  static constexpr int64_t kPrograms = int64_t{100} << 20;  // code, libraries and small things
};

// What is kept of the photos besides themselves.
struct PhotoMaps {
  int bytes = 0;  // for each pixel of a photo: its mask
  // How many pixels the photo's depth map has, by its name; those that are not there have none. A
  // map is kept at its own size if that is smaller than the photo's.
  std::map<std::string, int64_t> depth;
  bool has_confidence = true;  // each pixel of depth has one
  bool stereo = false;         // makes them
};

// `masks`: the photos have some. Reads how large depth maps are.
PhotoMaps MapsOf(absl::Span<const ScreenedPhoto> photos, const ReconstructInput& input,
                 const ReconstructOptions& options, bool masks);

// `threads` > 0 work at once.
MemoryEstimate EstimateMemory(absl::Span<const ScreenedPhoto> photos,
                              const ReconstructOptions& options, int threads,
                              const PhotoMaps& maps);

// RESOURCE_EXHAUSTED (MEMORY_EXCEEDED, field "options.max_image_side") where even the least that
// `photos` take is more than `bytes`; says how many threads or which max_image_side would do. OK
// where bytes is 0.
absl::Status CheckMemory(absl::Span<const ScreenedPhoto> photos, const ReconstructOptions& options,
                         const PhotoMaps& maps, int64_t bytes);

// A sentence for people: what a run takes, and what there is; where it cannot fit, CheckMemory's.
std::string DescribeMemory(absl::Span<const ScreenedPhoto> photos,
                           const ReconstructOptions& options, const PhotoMaps& maps, int64_t bytes);

}  // namespace litags

#endif  // LITAGS_ENGINE_PIPELINE_MEMORY_ESTIMATE_H_
