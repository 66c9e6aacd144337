// Frames are picked in a process of its own, which may only compute: a video is a stranger's file,
// and its decoders are large.
#ifndef LITAGS_ENGINE_VIDEO_FRAME_PROCESS_H_
#define LITAGS_ENGINE_VIDEO_FRAME_PROCESS_H_

#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "engine/core/cancel.h"
#include "engine/video/pick_frames.h"

namespace litags {

// The word behind a program's name that makes it pick frames.
inline constexpr char kPickFramesCommand[] = "pick-frames";

// For the first line of main(): the exit code if the program was started to pick frames.
std::optional<int> MaybePickFrames(int argc, char** argv);

// How a program that calls MaybePickFrames() starts itself for it.
std::vector<std::string> OwnPickFramesProgram();

// Writes the chosen frames of the video at `path` as `dir`/frame_0001.png, ...; `dir` exists.
// `program`: a program that calls MaybePickFrames(), and its first arguments; empty: this process
// decodes. Errors of PickFrames; VIDEO_TOO_COSTLY if it takes more than 3 GiB or two hours of a
// processor; VIDEO_CORRUPT if the process crashes; CANCELLED; NOT_FOUND.
absl::StatusOr<PickedFrames> PickFramesInto(const std::string& dir, const std::string& path,
                                            const std::string& field, int most,
                                            const std::vector<std::string>& program,
                                            const FrameProgress& progress,
                                            const CancelToken& cancel);

}  // namespace litags

#endif  // LITAGS_ENGINE_VIDEO_FRAME_PROCESS_H_
