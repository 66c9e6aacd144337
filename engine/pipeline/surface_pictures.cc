#include "engine/pipeline/surface_pictures.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "engine/core/error.h"
#include "engine/core/spread_indices.h"
#include "engine/export/formats.h"
#include "engine/export/quantize.h"
#include "engine/export/viewer_scene.h"
#include "engine/pipeline/render_rules.h"

namespace litags {
namespace {

constexpr size_t kMostCameras = 64;
constexpr double kMostSide = 640;       // px, of a picture
constexpr double kMostPixels = 4e6;     // of all pictures
constexpr float kOpaque = 0.9f;         // least coverage of a pixel
constexpr float kEdge = kOtherSurface;  // of the depth, between neighbours

Camera Shrunk(const Camera& camera, size_t cameras) {
  const double pixels = double(camera.width) * camera.height;
  const double share = std::min({1.0, kMostSide / std::max(camera.width, camera.height),
                                 std::sqrt(kMostPixels / cameras / pixels)});
  return camera.Scaled(std::max(1, static_cast<int>(share * camera.width)),
                       std::max(1, static_cast<int>(share * camera.height)));
}

// Whether the pixel and its four neighbours are of one surface.
bool IsSurface(const Planes& depths, const Planes& alpha, int x, int y) {
  const float depth = depths.at(0, y, x);
  if (!(depth > 0) || alpha.at(0, y, x) < kOpaque) return false;
  for (const auto& [dx, dy] : {std::pair{1, 0}, {-1, 0}, {0, 1}, {0, -1}}) {
    if (std::abs(depths.at(0, y + dy, x + dx) - depth) > kEdge * depth) return false;
  }
  return true;
}

absl::StatusOr<SurfacePicture> Rendered(const Scene& scene, const Camera& camera,
                                        const ExportRequest& request) {
  RenderRequest wanted;
  wanted.camera = camera;
  wanted.threads = request.threads;
  wanted.cancel = request.cancel;
  wanted.channel = Channel::kDepth;
  LITAGS_ASSIGN_OR_RETURN(const Planes depth, scene.Render(wanted));
  wanted.channel = Channel::kAlpha;
  LITAGS_ASSIGN_OR_RETURN(const Planes alpha, scene.Render(wanted));
  wanted.channel = request.light == 0 ? Channel::kColor : Channel::kLight;
  wanted.light = request.light;
  wanted.exposure_stops = request.exposure_stops;
  LITAGS_ASSIGN_OR_RETURN(const Planes color, scene.Render(wanted));
  SurfacePicture picture;
  picture.camera = camera;
  picture.depth = Planes(1, camera.height, camera.width);
  picture.color = ImageU8(camera.width, camera.height);
  for (int y = 1; y + 1 < camera.height; ++y) {
    for (int x = 1; x + 1 < camera.width; ++x) {
      if (!IsSurface(depth, alpha, x, y)) continue;
      picture.depth.at(0, y, x) = depth.at(0, y, x);
      for (int k = 0; k < 3; ++k) {
        picture.color.pixel(x, y)[k] = PackByte(255 * color.at(k, y, x));
      }
    }
  }
  return picture;
}

}  // namespace

absl::StatusOr<std::vector<SurfacePicture>> SurfacePictures(const Scene& scene,
                                                            const ExportRequest& request) {
  LITAGS_RETURN_IF_ERROR(CheckExport(request));
  const std::vector<View>& views = scene.views();
  const std::vector<size_t> used = SpreadIndices(views.size(), kMostCameras);
  std::vector<SurfacePicture> pictures;
  for (const size_t v : used) {
    const Camera camera = Shrunk(views[v].camera, used.size());
    LITAGS_ASSIGN_OR_RETURN(SurfacePicture picture, Rendered(scene, camera, request));
    pictures.push_back(std::move(picture));
  }
  return pictures;
}

int LeastCameras(const std::vector<SurfacePicture>& pictures) {
  return pictures.size() > 1 ? 2 : 1;
}

absl::Status NoSurface(const ExportRequest& request) {
  const bool cropped = request.crop.has_value();
  return MakeError(absl::StatusCode::kFailedPrecondition, "EXPORT_EMPTY", cropped ? "crop" : "",
                   cropped
                       ? "crop: no surface that two cameras see is in the box; its corners are "
                         "in the coordinates of the scene's cameras"
                       : "the scene has no surface that two of its cameras see; take more photos "
                         "of each place, or export Gaussians, as format ply");
}

void PlacePoints(const Scene& scene, const ExportRequest& request, PointCloud* points) {
  const UpAxis axis = request.up == UpAxis::kOfFormat ? InfoOf(request.format).up : request.up;
  const Matrix3 r = RotationTo(scene.up(), axis);
  for (ColoredPoint& point : *points) {
    const std::array<double, 3> p = point.xyz;
    for (size_t k = 0; k < 3; ++k) {
      point.xyz[k] = request.scale * (r[3 * k] * p[0] + r[3 * k + 1] * p[1] + r[3 * k + 2] * p[2]);
    }
  }
}

}  // namespace litags
