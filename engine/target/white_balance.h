// The colour of a capture's light: is it a strong cast, as of sodium lamps, or what photos have?
#ifndef LITAGS_ENGINE_TARGET_WHITE_BALANCE_H_
#define LITAGS_ENGINE_TARGET_WHITE_BALANCE_H_

#include <array>
#include <optional>
#include <string>

#include "absl/types/span.h"
#include "engine/core/color.h"
#include "engine/core/photo.h"

namespace litags {

// Logarithms of red / green and of blue / green, in linear light.
using Chromaticity = std::array<double, 2>;

// The chromaticity of a photo: shades of grey (Finlayson and Trezzi 2004), the mean of power 6 of
// linear light, over blocks of 4x4 pixels, which average the noise. Blocks with a clipped sample or
// a masked pixel do not count; nothing if none counts, or if one channel shows no light at all and
// green neither. Each logarithm is within +-kMostCast. Does not depend on the exposure.
std::optional<Chromaticity> ChromaticityOf(const Photo& photo, const PlaneU8& mask);

// The light's cast: photos show linear light that is red, green, blue times these; green's is 1.
// `chromaticities` are those of the capture's photos, whose own white balances are even by now
// (response.h); their medians count.
//
// Contract: {1, 1, 1}, exactly, unless the cast is implausibly strong: unless the medians lie five
// deviations or more from the mean of photos with a good white balance. Then what they differ by
// from that mean. So photos of warm or coloured rooms stay what they are, and only light that no
// camera's white balance could take out is neutralised. Nor is there a cast where both red and blue
// lie below that mean, so that green outshines both: lamps are red or blue against the sun, but
// leaves and grass are green. A green lamp's light therefore stays as it is. Values are finite,
// from exp(-kMostCast) to exp(kMostCast).
std::array<double, 3> SceneWhiteBalance(absl::Span<const Chromaticity> chromaticities);

inline constexpr double kMostCast = 2.8;  // log: 4 stops; more is noise

// For people; empty without a cast.
std::string DescribeCast(const std::array<double, 3>& cast);

}  // namespace litags

#endif  // LITAGS_ENGINE_TARGET_WHITE_BALANCE_H_
