// Videos as phones and cameras make them, for tests.
#ifndef LITAGS_ENGINE_VIDEO_TESTING_VIDEO_H_
#define LITAGS_ENGINE_VIDEO_TESTING_VIDEO_H_

#include <string>
#include <vector>

#include "engine/core/image.h"

namespace litags {

struct TestVideo {
  std::string container = "mov";  // FFmpeg's names
  std::string codec = "libx264";
  std::string pixels = "yuv420p";
  std::string quality = "12";  // constant rate factor, where the codec has one
  int frames_per_second = 30;
  int gap = 1;                         // every frame lasts as long as so many
  int quarters = 0;                    // clockwise, that a player turns the pictures by
  bool mirror = false;                 // a player changes left and right before it turns them
  int aspect_num = 1, aspect_den = 1;  // of a pixel
  bool bt2020_hlg = false;
  bool bt601 = false;  // else BT.709
  bool full_range = false;
  bool pq = false;
  bool interlaced = false;
  bool with_sound_only = false;  // no pictures
  int sound_seconds = 0;         // of silence beside the pictures
  std::string sphere;            // "equirectangular", "cubemap": FFmpeg's names
  bool contents_first = false;   // the table of contents before the pictures (MP4, MOV)
};

// All frames of one size, with even sides. Empty if this FFmpeg cannot.
std::string EncodeVideo(const std::vector<ImageU8>& frames, const TestVideo& options);

// As a sensor sees it that must be turned by a quarter, clockwise.
ImageU8 OnItsSide(const ImageU8& image);

// A phone's walk past a textured wall: `count` frames that move by `step` px each, some of them
// blurred by motion as `blurred` says.
std::vector<ImageU8> WalkFrames(int width, int height, int count, double step,
                                const std::vector<int>& blurred = {});

}  // namespace litags

#endif  // LITAGS_ENGINE_VIDEO_TESTING_VIDEO_H_
