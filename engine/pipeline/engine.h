// The engine as the server and the tools see it: photos in, a scene out, pictures of the scene.
// This header is the whole contract between server and engine; it knows nothing of gRPC or SQL.
#ifndef LITAGS_ENGINE_PIPELINE_ENGINE_H_
#define LITAGS_ENGINE_PIPELINE_ENGINE_H_

#include <memory>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "engine/core/cancel.h"
#include "engine/depth/depth_network.h"
#include "engine/pipeline/options.h"
#include "engine/pipeline/report.h"
#include "engine/pipeline/scene.h"

namespace litags {

struct ReconstructInput {
  std::string images_dir;    // photos, flat; names are the views' names
  std::string video_path;    // instead of images_dir: frames of it become the photos
  std::string cameras_path;  // transforms*.json or a COLMAP model folder; empty: run SfM
  // Those cameras are of the photos upright, whatever their sizes say.
  bool cameras_are_upright = false;
  // <photo name>.{npy,pfm,png} or <photo stem>.{npy,pfm,png}. Photos may lack one. Empty: none
  // given.
  std::string depth_dir;
  // <photo name>.png or <photo stem>.png, 8 bits, of the photo's upright size: 0 where a pixel is
  // not of the scene and must not be learnt. Photos may lack one. Empty: none given.
  std::string masks_dir;
  std::string work_dir;  // exists; SfM workspace, checkpoint, snapshots and results go here

  DepthNetwork depth_network;
  int64_t memory_bytes = 0;           // that there are; 0: not known
  double colmap_step_seconds = 3600;  // wall clock of one COLMAP step; 0: no limit
  // How the program is called that decodes a video, in a process that may do nothing else: one
  // whose main() begins with MaybePickFrames() (engine/video/frame_process.h). Empty: this process
  // decodes it.
  std::vector<std::string> frame_program;
};

class Engine {
 public:
  virtual ~Engine() = default;

  // Photos to scene. Several may run at once, each in a work_dir of its own: one that another run
  // is in is refused (FAILED_PRECONDITION, WORK_DIR_IN_USE). OpenCV's number of threads belongs to
  // the process: the run that began last sets it, and the last to end puts back what the first
  // found. A video that this process decodes sets FFmpeg's log level (quiet) and largest
  // allocation, which stay. No input may lie in a folder that the run writes into
  // (INPUT_IN_WORK_DIR), nor any other file that no run has made (FOLDER_NOT_OURS). Resumes from
  // work_dir's checkpoint if there is one made from the same photos and options, save more
  // iterations of the same schedule; one of more iterations than are wanted, or of a newer program,
  // is refused (CHECKPOINT_TOO_LONG, CONTAINER_TOO_NEW), not replaced. CANCELLED soon after the
  // token is raised; INVALID_ARGUMENT or FAILED_PRECONDITION (with an ErrorDetail) if the photos
  // cannot give a scene. `observer` may be null.
  virtual absl::StatusOr<ReconstructReport> Reconstruct(const ReconstructInput& input,
                                                        const ReconstructOptions& options,
                                                        const CancelToken& cancel,
                                                        ReconstructObserver* observer) = 0;

  virtual absl::StatusOr<std::shared_ptr<const Scene>> LoadScene(const std::string& path) = 0;
};

// The real one. `colmap` is the program's name or path.
std::unique_ptr<Engine> MakeEngine(std::string colmap = "colmap");

}  // namespace litags

#endif  // LITAGS_ENGINE_PIPELINE_ENGINE_H_
