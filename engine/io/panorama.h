// Telling panoramas, as cameras for 360 degrees and phones write them, from other photos.
#ifndef LITAGS_ENGINE_IO_PANORAMA_H_
#define LITAGS_ENGINE_IO_PANORAMA_H_

#include <optional>
#include <string>
#include <string_view>

#include "engine/core/photo.h"
#include "engine/io/wide_lens.h"

namespace litags {

// What a file's metadata (XMP, GPano) says of an equirectangular panorama whose photo has this
// size; nullopt: nothing. Without words of a part it is the whole, if its sides are 2 to 1.
std::optional<PanoramaPart> StatedPanorama(std::string_view bytes, int width, int height);

// The PNG with the words that all of it is a panorama.
std::string WithStatedPanorama(std::string png);

// Whether a photo twice as wide as high goes on from its right edge at its left one.
bool IsClosedAround(const Photo& photo);

// A photo that is all of the sphere.
PanoramaPart WholePanorama(int width, int height);

}  // namespace litags

#endif  // LITAGS_ENGINE_IO_PANORAMA_H_
