// Distances from points to a surface.
#ifndef LITAGS_ENGINE_TOOLS_EVALUATION_SURFACE_DISTANCE_H_
#define LITAGS_ENGINE_TOOLS_EVALUATION_SURFACE_DISTANCE_H_

#include <cstdint>
#include <vector>

#include "engine/export/triangle_mesh.h"

namespace litags {

struct NearestSurface {
  double distance;  // scene units
  uint32_t vertex;  // the nearest one
};

// From each point to the triangles at its four nearest vertices, and to these vertices where they
// have no triangle, as those of a point cloud. Where triangles are much larger than their distances
// from the point, a nearer one may be missed: the distance is then too long. `surface` is not
// empty.
std::vector<NearestSurface> NearestOf(const PointCloud& points, const TriangleMesh& surface);

// From a point to a triangle, scene units.
double DistanceToTriangle(const std::array<double, 3>& point, const std::array<double, 3>& a,
                          const std::array<double, 3>& b, const std::array<double, 3>& c);

}  // namespace litags

#endif  // LITAGS_ENGINE_TOOLS_EVALUATION_SURFACE_DISTANCE_H_
