// The surfaces of a scene as triangles.
#ifndef LITAGS_ENGINE_PIPELINE_SURFACE_MESH_H_
#define LITAGS_ENGINE_PIPELINE_SURFACE_MESH_H_

#include "absl/status/statusor.h"
#include "engine/export/triangle_mesh.h"
#include "engine/pipeline/scene.h"

namespace litags {

// SurfacePictures fused into a signed distance (tsdf_volume.h), and where it is zero as triangles
// (surface_nets.h) that at least two cameras see. Parts too small to be told from errors of depth
// are removed. Light, exposure, crop, up and scale are those of the request. The same scene makes
// the same mesh. Errors: those of SurfacePictures; FAILED_PRECONDITION (EXPORT_EMPTY) if there is
// no surface.
absl::StatusOr<TriangleMesh> SurfaceMesh(const Scene& scene, const ExportRequest& request);

}  // namespace litags

#endif  // LITAGS_ENGINE_PIPELINE_SURFACE_MESH_H_
