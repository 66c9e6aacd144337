// Single-photo enhancers: the peers that LITA-GS is compared with. They see one photo and nothing
// of the scene. CLAHE prepares photos for COLMAP, too.
#ifndef LITAGS_ENGINE_ENHANCE_ENHANCE_H_
#define LITAGS_ENGINE_ENHANCE_ENHANCE_H_

#include <functional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "engine/core/image.h"

namespace litags {

// Mean of all codes that the curves below bring a photo to; authors' release of LITA-GS (theta).
inline constexpr double kEnhancedMean = 0.49;

// Each takes a photo (sRGB codes, not empty) and returns one of the same size. Pure functions, for
// any number of threads at once. An all-black photo comes back as it is from all but LIME and the
// histogram methods, which keep it dark.

// codes * theta / mean, clipped: the paper's pseudo-target.
ImageU8 EnhanceGain(const ImageU8& photo);
// The gain in linear light, clipped at white, that brings the mean code to theta.
ImageU8 EnhanceLightGain(const ImageU8& photo);
// code^g (in [0, 1]) with the g that brings the mean code to theta.
ImageU8 EnhanceGamma(const ImageU8& photo);
// Histogram equalisation of each channel.
ImageU8 EnhanceHistogram(const ImageU8& photo);
// Contrast-limited adaptive equalisation (Zuiderveld 1994) of Lab lightness, 8x8 tiles, limit 4.
ImageU8 EnhanceClahe(const ImageU8& photo);
// Retinex by an illumination map: LIME (Guo, Li and Ling, IEEE TIP 2017), without its final
// denoising. Photos whose mean is above theta are enhanced as negatives, as the over-exposed part
// of dual illumination estimation (Zhang, Nie and Zheng 2019) is.
ImageU8 EnhanceLime(const ImageU8& photo);

// An enhancer by its name in tables and on command lines.
struct Enhancer {
  std::string name;
  std::function<absl::StatusOr<ImageU8>(const ImageU8&)> run;
};

// The ones above: gain, light-gain, gamma, histeq, clahe, lime.
const std::vector<Enhancer>& BuiltinEnhancers();

}  // namespace litags

#endif  // LITAGS_ENGINE_ENHANCE_ENHANCE_H_
