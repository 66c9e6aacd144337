// What a render request asks for, checked and resolved against a scene.
#ifndef LITAGS_SERVER_API_VIEW_REQUEST_H_
#define LITAGS_SERVER_API_VIEW_REQUEST_H_

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "engine/core/camera.h"
#include "engine/io/file_util.h"
#include "engine/pipeline/scene.h"
#include "litags/v1/render_service.pb.h"

namespace litags {

// Checks channel, light, exposure, format and JPEG quality; `camera` is left alone.
absl::StatusOr<RenderRequest> ResolveContent(const v1::RenderSettings& settings);

// What the frames of a path show, between its first and its last.
struct PathContent {
  RenderRequest first, last;  // `camera` is left alone

  RenderRequest Frame(int frame, int frames) const;
};

absl::StatusOr<PathContent> ResolvePathContent(const v1::RenderPathRequest& request);

// Size and lens of the pictures; the pose is that of the camera the lens was taken from, the one
// called `camera_name` or, if that is empty, the scene's first.
absl::StatusOr<Camera> ResolveLens(const v1::RenderSettings& settings,
                                   const std::string& camera_name, const std::string& field,
                                   const Scene& scene, int64_t max_pixels);

// Finds the cameras of photos by their names. Not thread-safe.
class CameraFinder {
 public:
  // `scene` must outlive this.
  explicit CameraFinder(const Scene& scene) : scene_(scene) {}

  // Case and ending do not matter where one photo is meant. NOT_FOUND (CAMERA_NOT_FOUND).
  absl::StatusOr<Camera> Find(const std::string& name, const std::string& field);
  const Scene& scene() const { return scene_; }

 private:
  const Scene& scene_;
  std::vector<std::string> names_;  // once one is not there letter by letter
  std::optional<NameIndex> index_;
};

// `lens` moved to the pose. `field` is where the pose stands in the request: "pose".
absl::StatusOr<Camera> ResolvePose(const v1::Pose& pose, const Camera& lens, CameraFinder& cameras,
                                   const std::string& field);
inline absl::StatusOr<Camera> ResolvePose(const v1::Pose& pose, const Camera& lens,
                                          const Scene& scene, const std::string& field) {
  CameraFinder cameras(scene);
  return ResolvePose(pose, lens, cameras, field);
}

v1::Camera CameraToProto(const Camera& camera);

}  // namespace litags

#endif  // LITAGS_SERVER_API_VIEW_REQUEST_H_
