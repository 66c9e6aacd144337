// What the photos' cameras see of a scene's surfaces: the input of exported points and meshes.
#ifndef LITAGS_ENGINE_PIPELINE_SURFACE_PICTURES_H_
#define LITAGS_ENGINE_PIPELINE_SURFACE_PICTURES_H_

#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "engine/export/point_cloud.h"
#include "engine/pipeline/scene.h"
#include "engine/surface/surface_picture.h"

namespace litags {

// Depth and colour rendered from up to 64 of the photos' cameras, at most 640 px on the longer side
// and 4 million pixels in all. Depth is known where the pixel is opaque and no edge is near.
// Colours are in the request's light and exposure; its crop is not applied. Errors: those of
// CheckExport and Scene::Render.
absl::StatusOr<std::vector<SurfacePicture>> SurfacePictures(const Scene& scene,
                                                            const ExportRequest& request);

// How many of the cameras must see a surface: two, so that most of what floats before one camera is
// left out, or the only one.
int LeastCameras(const std::vector<SurfacePicture>& pictures);

// FAILED_PRECONDITION (EXPORT_EMPTY): there is no surface, or none in the request's crop.
absl::Status NoSurface(const ExportRequest& request);

// Turns and scales points as PlaceScene does Gaussians.
void PlacePoints(const Scene& scene, const ExportRequest& request, PointCloud* points);

}  // namespace litags

#endif  // LITAGS_ENGINE_PIPELINE_SURFACE_PICTURES_H_
