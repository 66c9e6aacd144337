#include "engine/tools/table/path_flicker.h"

#include <cmath>
#include <utility>
#include <vector>

#include "engine/core/camera_path.h"
#include "engine/core/error.h"
#include "engine/core/photo.h"
#include "engine/tools/evaluation/evaluation.h"

namespace litags {
namespace {

absl::Status NoPath(const std::string& why) {
  return MakeError(absl::StatusCode::kFailedPrecondition, "NO_PATH", "--flicker",
                   "--flicker: " + why);
}

// As a viewer sees it: bytes, enhanced.
absl::StatusOr<PathFrame> RenderFrame(const Scene& scene, const Camera& camera,
                                      const Enhancer* after, int threads) {
  LITAGS_ASSIGN_OR_RETURN(ImageU8 picture, RenderPicture(scene, {"", camera}, threads));
  if (after != nullptr) {
    LITAGS_ASSIGN_OR_RETURN(picture, after->run(picture));
  }
  RenderRequest depth;
  depth.camera = camera;
  depth.channel = Channel::kDepth;
  depth.threads = threads;
  PathFrame frame{camera, ToPlanes(picture), Planes()};
  LITAGS_ASSIGN_OR_RETURN(frame.depth, scene.Render(depth));
  return frame;
}

double StandardDeviation(const std::vector<float>& values) {
  double sum = 0, squares = 0;
  for (const float v : values) {
    sum += v;
    squares += double(v) * v;
  }
  const double n = static_cast<double>(values.size()), mean = sum / n;
  return std::sqrt(std::max(0.0, squares / n - mean * mean));
}

}  // namespace

absl::StatusOr<PathFlicker> MeasurePathFlicker(const Scene& scene, int frames,
                                               const Enhancer* after, int threads) {
  std::vector<Camera> keys;
  for (const View& view : scene.views()) keys.push_back(view.camera);
  if (keys.size() < 2) return NoPath("a path needs two cameras");
  PathFlicker result;
  PathFrame last;
  for (const Camera& camera : PathThrough(keys, frames, /*closed=*/false, keys[0])) {
    LITAGS_ASSIGN_OR_RETURN(PathFrame frame, RenderFrame(scene, camera, after, threads));
    result.contrast += StandardDeviation(frame.color.data) / frames;
    if (!last.color.empty()) {
      LITAGS_ASSIGN_OR_RETURN(const Flicker step, MeasureFlicker(last, frame));
      result.steps.Add(step);
    }
    last = std::move(frame);
  }
  if (result.steps.compared == 0) return NoPath("no two frames show the same place; take more");
  return result;
}

}  // namespace litags
