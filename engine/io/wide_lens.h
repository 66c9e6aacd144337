// Lenses that see more than one pinhole picture can show, and pinhole views cut out of their
// photos.
#ifndef LITAGS_ENGINE_IO_WIDE_LENS_H_
#define LITAGS_ENGINE_IO_WIDE_LENS_H_

#include <array>
#include <functional>
#include <optional>

#include "engine/core/camera.h"
#include "engine/core/color.h"
#include "engine/core/photo.h"
#include "engine/io/sparse_model.h"

namespace litags {

// The faces of a cube around the camera; each view sees 90 degrees both ways.
struct CubeView {
  const char* name;
  std::array<double, 9> R;  // photo from view, row-major; axes as cameras have them
};
inline constexpr std::array<CubeView, 6> kCubeViews = {{
    {"front", {1, 0, 0, 0, 1, 0, 0, 0, 1}},
    {"right", {0, 0, 1, 0, 1, 0, -1, 0, 0}},
    {"back", {-1, 0, 0, 0, 1, 0, 0, 0, -1}},
    {"left", {0, 0, -1, 0, 1, 0, 1, 0, 0}},
    {"up", {1, 0, 0, 0, 0, -1, 0, 1, 0}},
    {"down", {1, 0, 0, 0, 0, 1, 0, -1, 0}},
}};

struct WideLens {
  int width = 0, height = 0;  // of the photo, px
  bool closed = false;        // the photo goes on from its right edge at its left one
  // Side of the views, px, even, 4096 at most: their middles have as many pixels an angle as the
  // photo has.
  int view_side = 0;
  // Where the photo shows a direction (camera axes, any length), px; nullopt: nowhere.
  std::function<std::optional<std::array<double, 2>>(const std::array<double, 3>&)> seen = nullptr;
};

// The part that a photo is of an equirectangular panorama: longitude grows with x from -180
// degrees, latitude falls with y from 90. In px of the whole panorama as the photo's px are large.
struct PanoramaPart {
  double whole_width = 0, whole_height = 0;
  double left = 0, top = 0;  // of the photo in it
};
WideLens PanoramaLens(int width, int height, const PanoramaPart& part);

// A fisheye whose photo shows a circle of this radius, px from the principal point; infinite: what
// the picture holds.
WideLens FisheyeLens(const Camera& camera, const Distortion& lens, double circle);

// The largest angle off the axis, radians, that it shows along the sides of its photo.
double FisheyeReach(const Camera& camera, const Distortion& lens);

// Beyond this a pinhole picture shows a direction at four times the size that its middle has:
// wider fisheyes are cut.
inline constexpr double kWidestPinhole = 1.0471975511965976;  // radians off the axis: 60 degrees

// Share of a view that the photo shows.
double SharedBy(const WideLens& lens, const CubeView& view);

// Bilinear; black where the photo shows nothing.
Photo CutView(const Photo& photo, const WideLens& lens, const CubeView& view);

// What of the view the photo shows; of these pixels, those that `mask` counts (of the photo's size,
// or empty: all).
PlaneU8 CutMask(const PlaneU8& mask, const WideLens& lens, const CubeView& view);

}  // namespace litags

#endif  // LITAGS_ENGINE_IO_WIDE_LENS_H_
