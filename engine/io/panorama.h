// Photos of the whole sphere, as cameras for 360 degrees write them, and pinhole views of them.
#ifndef LITAGS_ENGINE_IO_PANORAMA_H_
#define LITAGS_ENGINE_IO_PANORAMA_H_

#include <array>
#include <string_view>

#include "engine/core/image.h"
#include "engine/core/mask.h"
#include "engine/core/photo.h"

namespace litags {

// The faces of a cube around the camera; each view sees 90 degrees both ways.
struct PanoramaView {
  const char* name;
  std::array<double, 9> R;  // panorama from view, row-major; axes as cameras have them
};
inline constexpr std::array<PanoramaView, 6> kPanoramaViews = {{
    {"front", {1, 0, 0, 0, 1, 0, 0, 0, 1}},
    {"right", {0, 0, 1, 0, 1, 0, -1, 0, 0}},
    {"back", {-1, 0, 0, 0, 1, 0, 0, 0, -1}},
    {"left", {0, 0, -1, 0, 1, 0, 1, 0, 0}},
    {"up", {1, 0, 0, 0, 0, -1, 0, 1, 0}},
    {"down", {1, 0, 0, 0, 0, 1, 0, -1, 0}},
}};

// Side of the views, px, whose middles have as many pixels an angle as the panorama has at its
// equator; even. Their focal length is half of it.
int PanoramaViewSide(int panorama_width);

// Whether a file's metadata (XMP, GPano) says that it is an equirectangular panorama.
bool SaysPanorama(std::string_view bytes);

// Whether a photo twice as wide as high goes on from its right edge at its left one.
bool IsClosedAround(const Photo& photo);

// The view of an equirectangular panorama [W/2, W]: longitude grows with x from -180 degrees, and
// latitude falls with y from 90. Bilinear.
Photo CutPanoramaView(const Photo& panorama, const PanoramaView& view);

// The same of its mask, nearest pixels.
PlaneU8 CutPanoramaView(const PlaneU8& mask, const PanoramaView& view);

}  // namespace litags

#endif  // LITAGS_ENGINE_IO_PANORAMA_H_
