#include "engine/pipeline/surface_mesh.h"

#include <vector>

#include "engine/core/error.h"
#include "engine/pipeline/surface_pictures.h"
#include "engine/surface/surface_nets.h"
#include "engine/surface/surface_parts.h"
#include "engine/surface/tsdf_volume.h"

namespace litags {
namespace {

// Longest side of parts that are removed, in truncations. Choice: a lone blob of wrong depth fills
// what a picture says something about, the truncation on both sides.
constexpr double kSmallPart = 2;

}  // namespace

absl::StatusOr<TriangleMesh> SurfaceMesh(const Scene& scene, const ExportRequest& request) {
  LITAGS_ASSIGN_OR_RETURN(const std::vector<SurfacePicture> pictures,
                          SurfacePictures(scene, request));
  TsdfOptions options;
  options.center = scene.center();
  options.box = request.crop;
  options.threads = request.threads;
  options.cancel = request.cancel;
  TsdfVolume volume;
  LITAGS_RETURN_IF_ERROR(volume.Fuse(pictures, options));
  TriangleMesh mesh = SurfaceNets(volume, LeastCameras(pictures), request.threads);
  RemoveSmallParts(kSmallPart * volume.median_truncation(), &mesh);
  if (mesh.triangles.empty()) return NoSurface(request);
  PlacePoints(scene, request, &mesh.vertices);
  return mesh;
}

}  // namespace litags
