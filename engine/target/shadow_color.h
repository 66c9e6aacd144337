// Colour in deep shadow: inferred where the photo's codes no longer tell it.
#ifndef LITAGS_ENGINE_TARGET_SHADOW_COLOR_H_
#define LITAGS_ENGINE_TARGET_SHADOW_COLOR_H_

#include "absl/types/span.h"
#include "engine/core/color.h"
#include "engine/core/photo.h"
#include "engine/target/rounding.h"

namespace litags {

// A photo's mean colour and its noise, as the camera wrote them. `chroma_step`: see ImageInfo; 0
// for photos that are not JPEGs. Pixels that do not count by `mask` (engine/core/mask.h) say
// nothing.
ColorPrior MeasureColorPrior(const Photo& photo, double chroma_step, const PlaneU8& mask = {});

// The median of each figure, of photos of one capture; the largest chroma step.
ColorPrior MedianPrior(absl::Span<const ColorPrior> priors);

// Infers the colours of dark pixels, photo by photo, before any gain. Photos are as a decoder
// leaves them: samples in sRGB, with the fractions and the negative values that it found, and
// nothing done to them but a common gain of one. Half a second of one core for 2 megapixels.
//
// Two steps, each a posterior mean:
// 1. Rounding: every pixel below RoundingTable::kTop codes gets what colours that are rounded to
//    its code differ from it by, in the mean. Brightness changes, too, by up to half a code.
// 2. Neighbours: the ratio of chroma to luma in linear light is estimated over squares of 1, 2, 4,
//    ... 256 px. From large to small, the estimate m of a square moves from its parent's towards
//    its own observed ratio, by the share variance / (variance + noise / luma^2): bright squares
//    keep their own colour, dark ones take the colour of what is around them. The variance of a
//    square's colour about its parent's grows with the difference of their brightness, so that
//    edges of brightness keep colours apart; it was measured on 110 well exposed photos. The noise
//    is that of the two roundings and of the JPEG's quantisation.
//
// Pixels brighter than kShadowTop codes are returned as they are, and the change fades out from
// half of that. Pixels that `mask` (engine/core/mask.h) leaves out take the colour of what is
// around them if they are dark. Thread-safe; one thread each.
class ShadowColors {
 public:
  explicit ShadowColors(const ColorPrior& prior) : prior_(prior), rounding_(prior) {}

  Photo Infer(const Photo& photo, const PlaneU8& mask = {}) const;

 private:
  ColorPrior prior_;
  RoundingTable rounding_;
};

inline constexpr float kShadowTop = 64;  // codes of luma. Choice

}  // namespace litags

#endif  // LITAGS_ENGINE_TARGET_SHADOW_COLOR_H_
