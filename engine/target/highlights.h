// What clipped parts of an over-exposed photo may have looked like.
#ifndef LITAGS_ENGINE_TARGET_HIGHLIGHTS_H_
#define LITAGS_ENGINE_TARGET_HIGHLIGHTS_H_

#include <functional>

#include "engine/core/photo.h"
#include "engine/target/clipped_colors.h"
#include "engine/target/response.h"

namespace litags {

// The photo in sRGB after `curve`, which maps linear light (1: the photo's white) to a code in
// [0, 1], grows, and reaches 1 at or after 1 / gain (gain < 1). Samples that are not clipped go
// through the curve alone; `brightened` tells which the camera clipped. A clipped channel beside
// channels that are not is estimated from those and the colours of the scene (`colors`, for the
// photo's exposure), never below white.
//
// Where all channels are clipped the code goes kSurfaceFill of the way from white's to 1; less near
// borders up to which the photo grows brighter, since a surface is little brighter there, but not
// near sharp ones, where something else begins. Areas with few gradual borders are lamps or the
// sky, and go up to kLightFill further: one grey would turn glare into fog.
Photo FillHighlights(const Photo& photo, double gain, const ClippedColors& colors,
                     const std::function<double(double linear)>& curve,
                     const Brightening& brightened = {});

inline constexpr double kSurfaceFill = 0.6, kLightFill = 0.2;  // Choices, measured

}  // namespace litags

#endif  // LITAGS_ENGINE_TARGET_HIGHLIGHTS_H_
