// Where depth maps come from. The depth loss is blind to scale and offset, so every source plugs
// into the same interface: maps given by the user here, a network in network_depth.h, stereo in
// engine/stereo.
#ifndef LITAGS_ENGINE_DEPTH_DEPTH_PROVIDER_H_
#define LITAGS_ENGINE_DEPTH_DEPTH_PROVIDER_H_

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "absl/functional/function_ref.h"
#include "absl/status/statusor.h"
#include "absl/types/span.h"
#include "engine/core/camera.h"
#include "engine/core/cancel.h"
#include "engine/core/color.h"
#include "engine/core/photo.h"

namespace litags {

struct Distortion;

struct DepthMap {
  // [1, h, w], of the photo's size or, for the same view, smaller; finite; grows with distance
  // along the optical axis, up to one scale and offset per map.
  Planes depth;
  // [1, h, w] in [0, 1]; 0: nothing known there (depth is 0). Empty: known everywhere.
  Planes confidence;
  // Neighbours whose depths differ by more are two surfaces. None: those that differ by more than
  // 5 %, in maps whose depth is the distance itself.
  std::optional<float> edge = {};
};

// The `edge` of a map that may have any scale and offset: 5 % of what its depths span, those known
// and of the middle half.
float EdgeOf(const DepthMap& map);

// A plane with at most so many columns and rows: each pixel the mean of those under it. One that is
// smaller stays as it is: between its pixels ResizeDepth invents no depth at outlines. Throws
// cv::Exception.
Planes AverageDown(const Planes& plane, int most_width, int most_height);

// `map` at another size of the same view, or the `crop` of that: bilinear inside a surface, the
// nearest pixel at its edges and for the confidence. The memory of `out` is used again.
void ResizeDepth(const DepthMap& map, int width, int height, const PixelRect& crop, int threads,
                 DepthMap* out);
inline void ResizeDepth(const DepthMap& map, int width, int height, int threads, DepthMap* out) {
  ResizeDepth(map, width, height, {0, 0, width, height}, threads, out);
}

// A photo and its camera, of the same size.
struct PosedPhoto {
  const View* view = nullptr;
  const Photo* photo = nullptr;
  const Photo* target = nullptr;  // the photo normally lit; may be null: as it is
  // What the photo had when it was taken, and maps of it have; null: none.
  const Distortion* distortion = nullptr;
  const PlaneU8* mask = nullptr;  // pixels that do not count by it get no depth; may be null, empty
};

// `done` of `total` photos have their map.
using DepthProgress = absl::FunctionRef<void(int done, int total)>;

class DepthProvider {
 public:
  virtual ~DepthProvider() = default;

  // The maps of a whole capture, one entry a photo. nullopt: no map for this photo, train without.
  // An error: a map exists and is unusable, or CANCELLED. `progress` comes from this thread.
  virtual absl::StatusOr<std::vector<std::optional<DepthMap>>> Maps(
      absl::Span<const PosedPhoto> photos, const CancelToken& cancel, DepthProgress progress) = 0;
};

// Maps that the user gives with the photos, as FindDepthMap and ReadDepthMap have it, by view.name.
// 0 and what ReadDepthMap makes NaN mean unknown. Maps have the photo's aspect ratio
// (CheckDepthShape) and its way up; a larger one is averaged down over its known pixels, a smaller
// one stays as it is. A photo whose map is all unknown or constant has none, with a note in
// `notes`, if that is not null. INVALID_ARGUMENT with field "depth/<file>" for maps that cannot be
// read or do not fit. NOT_FOUND here if there is no such folder.
absl::StatusOr<std::unique_ptr<DepthProvider>> MakeFolderDepthProvider(
    const std::string& folder, std::vector<std::string>* notes = nullptr);

// INVALID_ARGUMENT (DEPTH_MAP_SIZE) unless a map of this size has the photo's aspect ratio, to 1 %.
// The photo's size is that of the photo upright; `orientation`: by which EXIF turned it.
absl::Status CheckDepthShape(int width, int height, int photo_width, int photo_height,
                             const std::string& field, int orientation = 1);

}  // namespace litags

#endif  // LITAGS_ENGINE_DEPTH_DEPTH_PROVIDER_H_
