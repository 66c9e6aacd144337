// Transparency of photos, as a mask.
#ifndef LITAGS_ENGINE_IO_ALPHA_MASK_H_
#define LITAGS_ENGINE_IO_ALPHA_MASK_H_

#include <string_view>

#include "engine/core/color.h"

namespace litags {

// What a PNG's alpha channel leaves of the photo: pixels that are less than half opaque do not
// count. Empty if all count, or none does, or there is no such channel. `png` was decoded before,
// so its size is within the limits.
PlaneU8 AlphaMask(std::string_view png);

}  // namespace litags

#endif  // LITAGS_ENGINE_IO_ALPHA_MASK_H_
