// A video as a capture: its chosen frames become the photos.
#ifndef LITAGS_ENGINE_PIPELINE_VIDEO_FRAMES_H_
#define LITAGS_ENGINE_PIPELINE_VIDEO_FRAMES_H_

#include <functional>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/types/span.h"
#include "engine/core/cancel.h"
#include "engine/pipeline/engine.h"

namespace litags {

// FAILED_PRECONDITION (VIDEO_NOT_ALONE) if anything comes with a video that says by names which
// photo it is of, such as "2 masks": a run chooses and names the frames, which another program that
// cut frames out did otherwise.
absl::Status CheckVideoAlone(absl::Span<const std::string> beside);

// Of a video: `input` with its frames, frame_0001.png and so on in work_dir/frames, as images_dir.
// Frames of an earlier run are kept if the video and `frames` are the same. Any other input comes
// back as it is. Errors of CheckVideoAlone and PickFramesInto.
absl::StatusOr<ReconstructInput> WithFramesAsPhotos(
    const ReconstructInput& input, int frames, const CancelToken& cancel,
    const std::function<void(const std::string&)>& progress, std::vector<std::string>* notes);

}  // namespace litags

#endif  // LITAGS_ENGINE_PIPELINE_VIDEO_FRAMES_H_
