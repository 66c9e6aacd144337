// Inside this module: from a frame's codes to sRGB.
#ifndef LITAGS_ENGINE_VIDEO_VIDEO_COLOR_H_
#define LITAGS_ENGINE_VIDEO_VIDEO_COLOR_H_

#include <cstdint>
#include <span>

#include "engine/core/photo.h"

struct AVFrame;

namespace litags {

// The matrix between Y'CbCr and R'G'B', as sws_getCoefficients() has it. Frames that do not say
// have BT.709's from 720 lines on, else BT.601's.
int MatrixOf(const AVFrame& frame);

// Whether black is 0 and white the largest code; else black is 16 and white 235 of 255.
bool HasFullRange(const AVFrame& frame);

// Whether codes are PQ's (HDR10), of light up to 10,000 cd/m^2.
bool HasPqLight(const AVFrame& frame);

// R'G'B' of 16 bits with the frame's primaries and curve into `photo`, of as many pixels: HLG
// becomes the light of the scene, other curves are taken for sRGB's; BT.2020 and P3 become sRGB's
// primaries.
void ToSrgb(std::span<const uint16_t> codes, const AVFrame& frame, Photo* photo);

}  // namespace litags

#endif  // LITAGS_ENGINE_VIDEO_VIDEO_COLOR_H_
