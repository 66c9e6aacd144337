// How wrong a picture may be, by brightness.
#ifndef LITAGS_ENGINE_CORE_NOISE_CURVE_H_
#define LITAGS_ENGINE_CORE_NOISE_CURVE_H_

#include <array>

namespace litags {

// Standard deviation of what is wrong with a picture where its luma is i / 255; 1 is white.
using NoiseCurve = std::array<float, 256>;

}  // namespace litags

#endif  // LITAGS_ENGINE_CORE_NOISE_CURVE_H_
