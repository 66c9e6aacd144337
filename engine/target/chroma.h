// Colour noise of dark photos.
#ifndef LITAGS_ENGINE_TARGET_CHROMA_H_
#define LITAGS_ENGINE_TARGET_CHROMA_H_

#include <functional>

#include "engine/core/color.h"
#include "engine/core/photo.h"

namespace litags {

// The photo in sRGB after `curve`, which maps linear light (1: the photo's white) to a code in
// [0, 1], grows, and reaches 1 at 1 / gain at the earliest: brightness (luma in linear light) pixel
// by pixel, but the colour, each channel's ratio to the luma, averaged over neighbours. In the dark
// a code or less of noise, rounding and JPEG's coarse chroma turn into colours that the scene does
// not have; many photos of it have them alike, since black cuts off one half of the noise, so
// training does not average them out.
//
// A joint bilateral filter of 17x17 pixels (every fourth is looked at, of a photo smoothed
// before): neighbours count by distance and by how alike the smoothed photos' codes after the
// curve are. They may differ by `strength` deviations of the noise, which is measured in the
// photo's own luma after the curve. What `mask` (engine/core/mask.h) leaves out says nothing about
// the noise and about other pixels' colours. With little noise (kVisibleChromaNoise) or a strength
// of 0 nothing is averaged.
Photo SmoothChroma(const Photo& photo, double gain, double strength,
                   const std::function<double(double linear)>& curve, const PlaneU8& mask = {});

inline constexpr double kVisibleChromaNoise = 1.5 / 255;  // deviation of codes. Choice

}  // namespace litags

#endif  // LITAGS_ENGINE_TARGET_CHROMA_H_
