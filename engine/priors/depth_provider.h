// Where depth maps come from. The depth loss is blind to scale and offset, so every source plugs
// into the same interface.
#ifndef LITAGS_ENGINE_PRIORS_DEPTH_PROVIDER_H_
#define LITAGS_ENGINE_PRIORS_DEPTH_PROVIDER_H_

#include <memory>
#include <optional>
#include <string>

#include "absl/status/statusor.h"
#include "engine/core/camera.h"
#include "engine/core/image.h"

namespace litags {

struct DepthMap {
  // [1, H, W] of the photo's size, finite; grows with distance along the optical axis, up to one
  // scale and offset per map.
  Planes depth;
  // [1, H, W] in [0, 1]; 0: nothing known there (depth is 0). Empty: known everywhere.
  Planes confidence;
};

class DepthProvider {
 public:
  virtual ~DepthProvider() = default;

  // The map of one view; `photo` has the size of view.camera. nullopt: no map for this view,
  // train without. An error: there is a map and it is unusable. Thread-safe.
  virtual absl::StatusOr<std::optional<DepthMap>> Depth(const View& view, const ImageU8& photo) = 0;
};

// Maps that the user gives with the photos: <folder>/<stem of view.name>.{png,pfm,npy}, the first
// that exists (formats: ReadDepthMap). 0 and values that are not finite mean unknown. A map of
// another size but the photo's aspect ratio (to 1%) is resized over its known pixels: averaged
// down, bilinear up. INVALID_ARGUMENT with field "depth/<file>" for maps that cannot be read, fit
// or used (all unknown, or constant). NOT_FOUND here if there is no such folder.
absl::StatusOr<std::unique_ptr<DepthProvider>> MakeFolderDepthProvider(const std::string& folder);

}  // namespace litags

#endif  // LITAGS_ENGINE_PRIORS_DEPTH_PROVIDER_H_
