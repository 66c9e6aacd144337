// How bright noise alone makes what no light fell on.
#ifndef LITAGS_ENGINE_TARGET_NOISE_FLOOR_H_
#define LITAGS_ENGINE_TARGET_NOISE_FLOOR_H_

#include "absl/types/span.h"
#include "engine/core/photo.h"

namespace litags {

// The mean light of a LightSquare, linear in the photos' own codes, up to which noise explains it;
// 0: none. Black cuts noise's darker half off, which leaves 0.40 of its deviation in the mean and
// 0.58 in the deviation (black_lift.h). So squares are noise where their pixels differ more than
// they are bright. Light of a fifth of the noise counts as noise, too, and so do squares of 8-bit
// photos of which two fifths of the pixels have code 1 and the others 0. In JPEGs compression takes
// much of the differences away: there the floor is too low.
// `masks`: see MaskOf. Deterministic for any `threads` (<= 0: all cores).
double NoiseFloor(absl::Span<const Photo> photos, int threads,
                  absl::Span<const PlaneU8> masks = {});

}  // namespace litags

#endif  // LITAGS_ENGINE_TARGET_NOISE_FLOOR_H_
