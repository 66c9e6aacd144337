// The surfaces of a scene as points.
#ifndef LITAGS_ENGINE_PIPELINE_SURFACE_POINTS_H_
#define LITAGS_ENGINE_PIPELINE_SURFACE_POINTS_H_

#include "absl/status/statusor.h"
#include "engine/export/point_cloud.h"
#include "engine/pipeline/scene.h"

namespace litags {

// Points of SurfacePictures; those of a small cube are one point, their mean, which at least two
// cameras must see. At most request.max_splats points, those that most pixels show. Light,
// exposure, crop, up and scale are those of the request. The same scene makes the same points.
// Errors: those of SurfacePictures; FAILED_PRECONDITION (EXPORT_EMPTY) if there are none.
absl::StatusOr<PointCloud> SurfacePoints(const Scene& scene, const ExportRequest& request);

}  // namespace litags

#endif  // LITAGS_ENGINE_PIPELINE_SURFACE_POINTS_H_
