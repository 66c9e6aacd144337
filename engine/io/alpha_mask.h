// Transparency of photos, as a mask.
#ifndef LITAGS_ENGINE_IO_ALPHA_MASK_H_
#define LITAGS_ENGINE_IO_ALPHA_MASK_H_

#include <string_view>

#include "engine/core/color.h"

namespace litags {

// What a PNG's alpha channel leaves of the upright photo: pixels that are less than half opaque do
// not count. Empty if all count, or none does, or there is no such channel, or the bytes are no
// PNG. They were decoded before, so that the size is within the limits; `orientation` is EXIF's.
PlaneU8 AlphaMask(std::string_view bytes, int orientation);

}  // namespace litags

#endif  // LITAGS_ENGINE_IO_ALPHA_MASK_H_
