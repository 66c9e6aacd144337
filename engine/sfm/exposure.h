// The light of a capture, and the copies of its photos that SIFT can work on.
#ifndef LITAGS_ENGINE_SFM_EXPOSURE_H_
#define LITAGS_ENGINE_SFM_EXPOSURE_H_

#include <string_view>
#include <vector>

#include "engine/core/color.h"
#include "engine/core/photo.h"
#include "engine/sfm/sfm.h"

namespace litags {

// Means over all pixels that count, and channels, of sRGB codes.
struct LightStats {
  double mean_level = 0;        // [0, 1]
  double clipped_fraction = 0;  // samples at white
};

LightStats MeasureLight(const Photo& photo, const PlaneU8& mask = {});

// Low below a mean of .25, over above .70 or with a quarter of the codes clipped.
// Choice: the benchmark's low captures have means of about .05 and its over-exposed ones .78 and
// more; well lit photos lie near .5 (.62 with a bright sky, 13 % of it clipped).
Exposure ClassifyExposure(const LightStats& stats);

enum class Preparation { kRaw, kGainBlur07, kGainBlur12, kGainClahe, kClahe };

std::string_view PreparationName(Preparation preparation);

// Preparations worth trying for a capture, best first.
std::vector<Preparation> Ladder(Exposure exposure);

// The prepared copy, same size. Gain: sRGB codes times .45 / mean of this photo, clipped (never
// darker than the photo; the mean is that of pixels that count). CLAHE: clip limit 4 on 8x8 tiles
// of Lab lightness, colour kept.
ImageU8 Prepare(const Photo& photo, Preparation preparation, const PlaneU8& mask = {});

}  // namespace litags

#endif  // LITAGS_ENGINE_SFM_EXPOSURE_H_
