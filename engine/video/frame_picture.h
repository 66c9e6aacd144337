// Inside this module: from a decoded frame to a picture as it is stored, not turned.
#ifndef LITAGS_ENGINE_VIDEO_FRAME_PICTURE_H_
#define LITAGS_ENGINE_VIDEO_FRAME_PICTURE_H_

#include "engine/core/image.h"
#include "engine/core/photo.h"

struct AVFrame;

namespace litags {

// Whether the two below read pixels of its kind: each component in a plane of its own, 8 to 16
// bits.
bool HasReadablePixels(const AVFrame& frame);

// Y', 1: white, the longer side at most `side` px.
Planes LumaOf(const AVFrame& frame, int side);

// In sRGB; what lies below black stays there.
Photo PictureOf(const AVFrame& frame);

}  // namespace litags

#endif  // LITAGS_ENGINE_VIDEO_FRAME_PICTURE_H_
