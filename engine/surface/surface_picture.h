// What one camera sees of surfaces.
#ifndef LITAGS_ENGINE_SURFACE_SURFACE_PICTURE_H_
#define LITAGS_ENGINE_SURFACE_SURFACE_PICTURE_H_

#include <array>
#include <optional>
#include <vector>

#include "engine/core/camera.h"
#include "engine/core/image.h"
#include "engine/export/export_request.h"

namespace litags {

struct SurfacePicture {
  Camera camera;
  Planes depth;   // [1, H, W], scene units along the camera's axis; 0: no surface is known
  ImageU8 color;  // [H, W, 3], sRGB

  bool Knows(int x, int y) const { return depth.at(0, y, x) > 0; }
  // World coordinates of what the pixel shows. It must be known.
  std::array<double, 3> PointAt(int x, int y) const;
  // Width of the pixel there, scene units.
  double WidthAt(int x, int y) const { return depth.at(0, y, x) / camera.fx; }
};

// The mean depth of the known among four pixels around; 0 where that of (u, v) is not known.
float DepthAt(const SurfacePicture& picture, double u, double v);

// [1, H, W]: how far a point is from the surface that a pixel shows, per unit of depth before or
// behind it: |n r| of the surface's normal and the pixel's ray r = ((x - cx) / fx, (y - cy) / fy,
// 1). From the depth of the pixels beside it; 1 where these are not known.
Planes FacingOf(const SurfacePicture& picture);

// Medians over all known pixels whose points are in the box; 0 without any.
struct MedianPixel {
  double width = 0, depth = 0;  // scene units
};
MedianPixel MedianPixelOf(const std::vector<SurfacePicture>& pictures,
                          const std::optional<Box>& box);

// How well pictures agree about a surface that several see: the 90 % quantile of the differences of
// their depths, as a share of the depth. Differences above kOtherSurface count as other surfaces.
// 0 if no two pictures see the same.
double DepthAgreement(const std::vector<SurfacePicture>& pictures);

// Choice: as between the pixels of one surface.
inline constexpr double kOtherSurface = 0.05;

}  // namespace litags

#endif  // LITAGS_ENGINE_SURFACE_SURFACE_PICTURE_H_
