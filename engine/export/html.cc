#include <nlohmann/json.hpp>
#include <string>

#include "absl/strings/escaping.h"
#include "absl/strings/str_replace.h"
#include "engine/core/error.h"
#include "engine/core/json_text.h"
#include "engine/export/formats.h"
#include "engine/viewer/viewer.h"

namespace litags {
namespace {

using Json = nlohmann::json;

Json VectorOf(const std::array<double, 3>& v) { return {{"x", v[0]}, {"y", v[1]}, {"z", v[2]}}; }

// The photos' cameras as litags.v1.Cameras has them, which do not count from the scene's origin. No
// name can end the script that holds them.
std::string CamerasOf(const ViewerScene& scene) {
  Json cameras = Json::array();
  for (const View& view : scene.views) {
    const Camera c = view.camera.Moved(scene.origin);
    cameras.push_back({{"name", view.name},
                       {"camera",
                        {{"width", c.width},
                         {"height", c.height},
                         {"intrinsics", {{"fx", c.fx}, {"fy", c.fy}, {"cx", c.cx}, {"cy", c.cy}}},
                         {"viewmat", {{"values", c.Viewmat()}}}}}});
  }
  std::array<double, 3> center;
  for (int k = 0; k < 3; ++k) center[k] = scene.center[k] + scene.origin[k];
  const Json all = {{"cameras", std::move(cameras)},
                    {"center", VectorOf(center)},
                    {"up", VectorOf(scene.up_direction)},
                    {"radius", scene.radius}};
  // A name may hold bytes that are no UTF-8.
  const std::string text = JsonText(all);
  return absl::StrReplaceAll(text, {{"<", "\\u003c"}});
}

}  // namespace

absl::StatusOr<std::string> EncodeHtml(const ViewerScene& scene) {
  if (ViewerModule().empty()) {
    return MakeError(absl::StatusCode::kFailedPrecondition, "EXPORT_NOT_BUILT", "format",
                     "format: html needs the viewer, which is not in this program, since node and "
                     "npm were not there when it was built; take another format, or build it again "
                     "with them");
  }
  LITAGS_ASSIGN_OR_RETURN(const std::string bytes, EncodeCompressedPly(scene));
  return absl::StrReplaceAll(std::string(ViewerPage()),
                             {{"@CAMERAS@", CamerasOf(scene)},
                              {"@SCENE@", absl::Base64Escape(bytes)},
                              {"@MODULE@", std::string(ViewerModule())}});
}

}  // namespace litags
