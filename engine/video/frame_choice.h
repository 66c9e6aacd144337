// Which frames of a video become photos: sharp ones, at equal steps of the camera's way.
#ifndef LITAGS_ENGINE_VIDEO_FRAME_CHOICE_H_
#define LITAGS_ENGINE_VIDEO_FRAME_CHOICE_H_

#include <memory>
#include <span>
#include <vector>

#include "engine/core/image.h"

namespace litags {

// The longer side of the luma that frames are measured on, px.
inline constexpr int kMeasuredSide = 640;

struct FrameFacts {
  // How much of what a large blur leaves is gone with it; compares frames of one place, whatever
  // their light. Larger: sharper.
  double sharpness = 0;
  // Of the picture from the first frame to this one, in parts of its longer side, summed up: the
  // median of how far its parts were shifted.
  double motion = 0;
};

// FrameFacts::sharpness of a picture.
double SharpnessOf(const Planes& luma);

// Measures the frames of one video in their order.
class FrameMeter {
 public:
  FrameMeter();
  ~FrameMeter();
  // `luma` as VideoFile::Luma(kMeasuredSide) gives it; all of one size.
  FrameFacts Measure(const Planes& luma);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

// At most this many without a wish, and at least these few if there are as many.
inline constexpr int kMostFrames = 300;
inline constexpr int kFewFrames = 12;
// Between two frames that are taken, as FrameFacts::motion: that of the sample capture's photos.
inline constexpr double kMotionStep = 0.04;

// Indices, ascending: `most` or fewer (0: kMostFrames), where motion asks for no more. Each is the
// sharpest of its part of the way, and not close to the next part. A camera that stands still gives
// kFewFrames at equal times.
std::vector<int> ChooseFrames(std::span<const FrameFacts> frames, int most);

}  // namespace litags

#endif  // LITAGS_ENGINE_VIDEO_FRAME_CHOICE_H_
