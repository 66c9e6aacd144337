// How a lamp that the camera carries lights the places of a photo.
#ifndef LITAGS_ENGINE_TARGET_LAMP_LIGHT_H_
#define LITAGS_ENGINE_TARGET_LAMP_LIGHT_H_

#include "absl/types/span.h"
#include "engine/core/image.h"
#include "engine/target/photometric.h"

namespace litags {

// PointSighting::lit all over one photo, coarsely: its mean (in the log domain) over the points of
// a square, and between points that of the squares around. 1 in a photo without points.
class LampLight {
 public:
  // `seen`: the photo's own sightings; width and height: px.
  LampLight(absl::Span<const PointSighting> seen, int width, int height);

  double At(double x, double y) const;  // px

 private:
  double side_;       // of a square, px
  Planes log_light_;  // [1, h, w], of squares
};

}  // namespace litags

#endif  // LITAGS_ENGINE_TARGET_LAMP_LIGHT_H_
