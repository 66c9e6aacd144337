// The surface of a fused volume as triangles.
#ifndef LITAGS_ENGINE_SURFACE_SURFACE_NETS_H_
#define LITAGS_ENGINE_SURFACE_SURFACE_NETS_H_

#include "engine/export/triangle_mesh.h"
#include "engine/surface/tsdf_volume.h"

namespace litags {

// A vertex in each cube of eight voxels where the distance changes its sign: the mean of the
// crossings on the cube's edges. Four cubes around an edge with a crossing make two triangles. Only
// voxels count whose surface at least `pictures` pictures show, within the truncation. The same
// mesh for any number of threads. Source: Gibson, "Constrained Elastic Surface Nets", MICCAI 1998,
// without its relaxation.
TriangleMesh SurfaceNets(const TsdfVolume& volume, int pictures, int threads);

}  // namespace litags

#endif  // LITAGS_ENGINE_SURFACE_SURFACE_NETS_H_
