// Connected parts of a mesh.
#ifndef LITAGS_ENGINE_SURFACE_SURFACE_PARTS_H_
#define LITAGS_ENGINE_SURFACE_SURFACE_PARTS_H_

#include "engine/export/triangle_mesh.h"

namespace litags {

// Removes connected parts whose bounding box has no side longer than `longest`, scene units, and
// vertices without a triangle. The others keep their order.
void RemoveSmallParts(double longest, TriangleMesh* mesh);

}  // namespace litags

#endif  // LITAGS_ENGINE_SURFACE_SURFACE_PARTS_H_
