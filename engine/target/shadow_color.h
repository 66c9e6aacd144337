// Colour in deep shadow: inferred where the photo's codes no longer tell it.
#ifndef LITAGS_ENGINE_TARGET_SHADOW_COLOR_H_
#define LITAGS_ENGINE_TARGET_SHADOW_COLOR_H_

#include <memory>

#include "absl/types/span.h"
#include "engine/core/color.h"
#include "engine/core/photo.h"

namespace litags {

class JpegChroma;

// What a photo's file rounds to.
struct FileSteps {
  double code = 1;    // of light, codes of 255: 1 for 8 bits, 1 / 257 for 16
  double chroma = 0;  // a JPEG's ImageInfo::chroma_step
};

// What is known of a capture's colours before its pixels are looked at.
struct ColorPrior {
  // Mean Cb / Y and Cr / Y of linear light (weights of ITU-R BT.601, Cb = (B - Y) / 1.772).
  double cb = 0, cr = 0;
  FileSteps steps;
  double luma_noise = 0;  // standard deviation in dark pixels (engine/noise), codes of 255
};

// A photo's mean colour and noise. Pixels that do not count by `mask` (engine/core/mask.h) say
// nothing.
ColorPrior MeasureColorPrior(const Photo& photo, const FileSteps& steps, const PlaneU8& mask = {});

// The medians of a capture's photos; the largest steps.
ColorPrior MedianPrior(absl::Span<const ColorPrior> priors);

// Infers the colours of dark pixels, photo by photo, before any gain. Half a second of one core for
// 2 megapixels.
//
// The ratio of chroma to luma in linear light is estimated over squares of 1, 2, 4, ... 256 px.
// From large to small, the estimate m of a square moves from its parent's towards its own observed
// ratio, by the share variance / (variance + noise / luma^2): bright squares keep their own colour,
// dark ones take the colour of what is around them. The variance of a square's colour about its
// parent's grows with the difference of their brightness, so that edges of brightness keep colours
// apart; it was measured on 110 well exposed photos. The noise is that of the sensor, of rounding
// to the file's codes and of the JPEG's quantisation; what JPEG's roundings hide of a square's own
// ratio is added first (JpegChroma). Luma stays.
//
// Pixels brighter than kShadowTop codes are returned as they are, and the change fades out from
// half of that. Pixels that `mask` leaves out take the colour of what is around them if they are
// dark. Thread-safe; one thread each.
class ShadowColors {
 public:
  explicit ShadowColors(const ColorPrior& prior);

  // `shrunk`: how many of the camera's pixels one of the photo's is wide, 1 as a decoder leaves it.
  // A shrunk photo has less noise and as much to infer for its size.
  Photo Infer(const Photo& photo, const PlaneU8& mask = {}, double shrunk = 1) const;

 private:
  ColorPrior prior_;
  std::shared_ptr<const JpegChroma> chroma_;
};

inline constexpr float kShadowTop = 64;  // codes of luma. Choice

}  // namespace litags

#endif  // LITAGS_ENGINE_TARGET_SHADOW_COLOR_H_
