#include "engine/tools/evaluation/true_depth.h"

#include <utility>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "engine/io/depth_io.h"
#include "engine/io/file_util.h"

namespace litags {

absl::StatusOr<std::optional<Planes>> ReadTrueDepth(const std::string& dir, const View& view) {
  const std::string path = FindDepthMap(dir, view.name);
  if (path.empty()) return std::nullopt;
  LITAGS_ASSIGN_OR_RETURN(Planes depth, ReadDepthMap(path, path));
  const Camera& camera = view.camera;
  if (depth.width == camera.width && depth.height == camera.height) return depth;
  return InvalidInput(
      "SIZE_MISMATCH", path,
      absl::StrCat(path, " is ", depth.width, "x", depth.height, ", the view ", camera.width, "x",
                   camera.height, "; give maps of the size that the scene is trained at"));
}

absl::StatusOr<Planes> NeedTrueDepth(const std::string& dir, const View& view,
                                     std::string_view field, std::string_view remedy) {
  LITAGS_ASSIGN_OR_RETURN(std::optional<Planes> depth, ReadTrueDepth(dir, view));
  if (depth.has_value()) return *std::move(depth);
  return InvalidInput(
      "NO_TRUTH", field,
      absl::StrCat(dir, " has no depth map of ", Stem(view.name), "; ", std::string(remedy)));
}

}  // namespace litags
