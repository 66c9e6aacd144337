// Inside this module: from a frame's codes to sRGB.
#ifndef LITAGS_ENGINE_VIDEO_VIDEO_COLOR_H_
#define LITAGS_ENGINE_VIDEO_VIDEO_COLOR_H_

#include <utility>

#include "engine/core/photo.h"
#include "engine/io/ycbcr.h"

struct AVFrame;

namespace litags {

// How its codes are meant. Frames that do not say have BT.709's matrix from 720 lines on, else
// BT.601's, and no full range unless they are R'G'B'.
YCbCrKind KindOf(const AVFrame& frame);

// Where samples of chroma lie, across and down; of frames that do not say as in MPEG-2.
std::pair<ChromaSite, ChromaSite> ChromaSitesOf(const AVFrame& frame);

// Whether codes are PQ's (HDR10), of light up to 10,000 cd/m^2.
bool HasPqLight(const AVFrame& frame);

// `photo` has R'G'B' of the frame's primaries and curve. HLG becomes the light of the scene, other
// curves are taken for sRGB's; BT.2020 and P3 become sRGB's primaries.
void ToSrgb(const AVFrame& frame, Photo* photo);

}  // namespace litags

#endif  // LITAGS_ENGINE_VIDEO_VIDEO_COLOR_H_
