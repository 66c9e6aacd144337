// What clipped parts of an over-exposed photo may have looked like.
#ifndef LITAGS_ENGINE_PRIORS_HIGHLIGHTS_H_
#define LITAGS_ENGINE_PRIORS_HIGHLIGHTS_H_

#include <functional>

#include "engine/core/image.h"
#include "engine/priors/clipped_colors.h"

namespace litags {

// The photo in sRGB after `curve`, which maps linear light (1: the photo's white) to a code in
// [0, 1], grows, and reaches 1 at or after 1 / gain (gain < 1). Samples that are not clipped go
// through the curve alone. A clipped channel beside channels that are not is estimated from those
// and the colours of the scene (`colors`, for the photo's exposure), never below white. Where all
// channels are clipped the code rises smoothly with the distance from the border, to
// kHighlightFill of the way to 1: one grey would turn glare into fog, and one step would draw its
// outline.
ImageU8 FillHighlights(const ImageU8& photo, double gain, const ClippedColors& colors,
                       const std::function<double(double linear)>& curve);

inline constexpr double kHighlightFill = 0.7;  // Choice, measured

}  // namespace litags

#endif  // LITAGS_ENGINE_PRIORS_HIGHLIGHTS_H_
