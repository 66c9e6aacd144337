// What of a folder or a video would be used, without training and without a server.
#ifndef LITAGS_ENGINE_TOOLS_INSPECT_INSPECT_H_
#define LITAGS_ENGINE_TOOLS_INSPECT_INSPECT_H_

#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "engine/core/cancel.h"
#include "engine/pipeline/engine.h"

namespace litags {

// Plain text: a line for each photo that would be used (size, lens, exposure, light in stops from
// the middle photo, sharpness beside the middle photo's, mask, camera), those left out and why, and
// what else there is to know, as the memory that a run with `options` takes. Writes found masks
// under work_dir, and, if `sheet` is not empty, a picture of all photos there (PNG, or JPEG by its
// ending). Errors of CheckHoldsPhotos, ScreenPhotos, ReadGivenCameras, CheckMapsFit and
// ReadDepthMap; with the text all the same, of a sheet that cannot be written, and TOO_FEW_PHOTOS
// as a run has it.
absl::Status InspectFolder(const ReconstructInput& input, const ReconstructOptions& options,
                           const std::string& sheet, const CancelToken& cancel, std::string* text);

bool IsVideoFile(const std::string& path);

// INVALID_ARGUMENT (NO_SUCH_FILE) for the name of a video that is not there: errors of folders
// would tell of a missing folder.
absl::Status CheckVideoIsThere(const std::string& path);

// INVALID_ARGUMENT (OPTION_UNUSED) if --frames is given for what is no video.
absl::Status CheckFramesAreOfVideo(int frames, bool is_video);

// The photos of a video, in work_dir; says on stderr how far it is. Other inputs as they are.
absl::StatusOr<ReconstructInput> PickFramesNow(const ReconstructInput& input, int frames,
                                               const CancelToken& cancel);

// Why --strict refuses the folder: the first photo that cannot be read. Else OK.
absl::Status CheckAllReadable(const ReconstructInput& input, int threads,
                              const CancelToken& cancel);

// A folder that goes with this object: what an inspection writes is of no use after it.
class ScratchFolder {
 public:
  ScratchFolder();
  ~ScratchFolder();
  ScratchFolder(const ScratchFolder&) = delete;
  ScratchFolder& operator=(const ScratchFolder&) = delete;
  const std::string& path() const { return path_; }

 private:
  std::string path_;
};

}  // namespace litags

#endif  // LITAGS_ENGINE_TOOLS_INSPECT_INSPECT_H_
