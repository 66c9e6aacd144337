// Flicker: how much the same place changes its look from one frame of a path to the next.
#ifndef LITAGS_ENGINE_EVAL_FLICKER_H_
#define LITAGS_ENGINE_EVAL_FLICKER_H_

#include <cstdint>

#include "absl/status/statusor.h"
#include "engine/core/camera.h"
#include "engine/core/image.h"

namespace litags {

struct PathFrame {
  Camera camera;
  Planes color;  // [3, H, W], sRGB-encoded, [0, 1]
  Planes depth;  // [1, H, W], distance along the optical axis, scene units; 0: nothing there
};

// Sums, so that steps of a path can be added up.
struct Flicker {
  double difference = 0;  // sum over compared pixels of the mean |difference| of their channels
  int64_t compared = 0;   // pixels
  int64_t pixels = 0;     // of all frames but the first

  void Add(const Flicker& step);
  double Mean() const { return compared > 0 ? difference / compared : 0; }
  double Share() const { return pixels > 0 ? double(compared) / pixels : 0; }
};

// `from` warped to the camera of `to` by the depth of `to`, and compared with it. A pixel counts if
// it lands inside `from` and the depth there, at all sixteen pixels that its colour is interpolated
// from, agrees to 2 %: it is then the same surface, seen from both places, away from outlines.
// Interpolation is bicubic (Catmull-Rom), which loses little sharpness: blurred scenes gain little
// by being easier to interpolate. INVALID_ARGUMENT (SIZE_MISMATCH) if planes do not fit cameras.
absl::StatusOr<Flicker> MeasureFlicker(const PathFrame& from, const PathFrame& to);

}  // namespace litags

#endif  // LITAGS_ENGINE_EVAL_FLICKER_H_
