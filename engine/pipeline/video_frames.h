// A video as a capture: its chosen frames become the photos.
#ifndef LITAGS_ENGINE_PIPELINE_VIDEO_FRAMES_H_
#define LITAGS_ENGINE_PIPELINE_VIDEO_FRAMES_H_

#include <functional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "engine/core/cancel.h"
#include "engine/pipeline/engine.h"

namespace litags {

// Of a video: `input` with its frames, frame_0001.png and so on in work_dir/frames, as images_dir.
// Frames of an earlier run are kept if the video and `frames` are the same. Any other input comes
// back as it is. Errors of PickFramesInto.
absl::StatusOr<ReconstructInput> WithFramesAsPhotos(
    const ReconstructInput& input, int frames, const CancelToken& cancel,
    const std::function<void(const std::string&)>& progress, std::vector<std::string>* notes);

}  // namespace litags

#endif  // LITAGS_ENGINE_PIPELINE_VIDEO_FRAMES_H_
