// Which colour a pixel has of which only some channels are known, the others being clipped.
#ifndef LITAGS_ENGINE_TARGET_CLIPPED_COLORS_H_
#define LITAGS_ENGINE_TARGET_CLIPPED_COLORS_H_

#include <array>
#include <vector>

#include "absl/types/span.h"
#include "engine/core/cancel.h"
#include "engine/core/color.h"
#include "engine/core/photo.h"
#include "engine/target/response.h"

namespace litags {

using Rgb = std::array<float, 3>;

// 0: a sample of this code, in [0, 1], was measured; 1: it is clipped. Grows smoothly between.
float Clippedness(float code);

// Colours of places of the scene: logarithms of linear light, 1: the white of a photo of exposure
// 1.
using ScenePalette = std::vector<Rgb>;

// Some thousand colours that the photos show unclipped. Of places where all channels are clipped
// nothing is known; they stand among them as white, as bright as photos cannot show, up to 1 /
// gain at exposure 1. `exposures`, `masks` and `brightened` as for MakeTargets (tone.h). The same
// for any `threads`; once cancelled, without the photos that are left.
ScenePalette CollectPalette(absl::Span<const Photo> photos, absl::Span<const double> exposures,
                            double gain, absl::Span<const PlaneU8> masks,
                            absl::Span<const Brightening> brightened = {}, int threads = 1,
                            const CancelToken& cancel = CancelToken());

// The colours of a palette as photos of one exposure clip them. A clipped pixel has the mean of
// the palette's colours, of any brightness, weighted by how well they agree with the channels
// that were measured and by whether they would have clipped the others. A lit orange of which red
// and green are clipped looks yellow; if the scene shows orange in the shade, and no such yellow,
// it was orange.
class ClippedColors {
 public:
  ClippedColors(const ScenePalette& palette, double exposure);

  // Logarithms of the channels' ratio to their mean, in linear light, for codes in [0, 1].
  Rgb LogRatio(const Rgb& codes) const;

 private:
  static constexpr int kNodes = 17;  // per channel, denser where samples start to be clipped

  const Rgb& Node(int r, int g, int b) const { return table_[(r * kNodes + g) * kNodes + b]; }

  std::vector<Rgb> table_;  // [kNodes, kNodes, kNodes]
};

}  // namespace litags

#endif  // LITAGS_ENGINE_TARGET_CLIPPED_COLORS_H_
