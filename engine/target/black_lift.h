// How black brightens noisy photos, and what they would be without it.
//
// Noise goes both ways, codes do not: they end at black, which cuts one half of the noise off where
// little light fell. Of light s with noise of deviation n of a normal distribution
//   g(s) = s Phi(s / n) + n phi(s / n)
// is left in the mean: 0.4 n of full darkness. Many photos average the noise out, but not that, and
// the gain of a dark capture makes grey shadows of it.
#ifndef LITAGS_ENGINE_TARGET_BLACK_LIFT_H_
#define LITAGS_ENGINE_TARGET_BLACK_LIFT_H_

#include "absl/types/span.h"
#include "engine/core/color.h"
#include "engine/core/photo.h"

namespace litags {

// The deviation n of the noise before black's cut, where the capture is darkest; linear light after
// the photos' gains (ToneTarget::gain), 1: white. Told from the darkest 2 % of the samples, by how
// bright they are, and how they differ from their neighbours: never more than makes darkness so
// bright, nor much more than the differences show. Fine texture counts as noise.
// `masks`: see MaskOf. `noise_kept`, (0, 1]: the share of the noise's deviation that is left in the
// photos: shrinking them averages noise, and not how bright it is. Deterministic for any `threads`
// (<= 0: all cores).
double NoiseAtBlack(absl::Span<const Photo> photos, absl::Span<const double> gains, int threads,
                    absl::Span<const PlaneU8> masks = {}, double noise_kept = 1);

// The light >= 0 that such noise made `light` of: the inverse of g.
double WithoutLift(double light, double noise);

}  // namespace litags

#endif  // LITAGS_ENGINE_TARGET_BLACK_LIFT_H_
