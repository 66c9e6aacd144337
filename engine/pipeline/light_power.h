#ifndef LITAGS_ENGINE_PIPELINE_LIGHT_POWER_H_
#define LITAGS_ENGINE_PIPELINE_LIGHT_POWER_H_

#include <algorithm>
#include <cmath>

namespace litags {

// L^t; L is kept off zero so that negative t stays finite.
inline float LightPower(float L, float t) { return std::pow(std::max(L, 1e-3f), t); }

}  // namespace litags

#endif  // LITAGS_ENGINE_PIPELINE_LIGHT_POWER_H_
