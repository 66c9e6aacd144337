// From a video to the pictures of its chosen frames.
#ifndef LITAGS_ENGINE_VIDEO_PICK_FRAMES_H_
#define LITAGS_ENGINE_VIDEO_PICK_FRAMES_H_

#include <cstdint>
#include <functional>
#include <string>
#include <string_view>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "engine/core/cancel.h"

namespace litags {

// What became of a video.
struct PickedFrames {
  int frames = 0;            // that it has, without damaged ones
  int64_t damaged = 0;       // that were passed over
  int chosen = 0;            // of them
  double seconds = 0;        // from the first to the last
  double whole_seconds = 0;  // that it should last if its end is missing; else 0
};

// "frame 300 of about 1800 looked at".
using FrameProgress = std::function<void(const std::string&)>;
// A chosen frame as PNG of 16 bits, which says if it is a panorama; they come in their order. An
// error ends the picking.
using FrameSink = std::function<absl::Status(const std::string& png)>;

// At most `most` frames (0: as ChooseFrames has it). Errors of VideoFile, of the sink, and
// INVALID_ARGUMENT (TOO_FEW_FRAMES) if fewer than kMinPhotos can be chosen; CANCELLED at the next
// frame.
absl::StatusOr<PickedFrames> PickFrames(std::string_view video, const std::string& field, int most,
                                        const FrameProgress& progress, const FrameSink& sink,
                                        const CancelToken& cancel = CancelToken());

}  // namespace litags

#endif  // LITAGS_ENGINE_VIDEO_PICK_FRAMES_H_
