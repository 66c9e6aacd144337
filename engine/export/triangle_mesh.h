// Surfaces as triangles with the colours of their corners, and the files that hold them.
#ifndef LITAGS_ENGINE_EXPORT_TRIANGLE_MESH_H_
#define LITAGS_ENGINE_EXPORT_TRIANGLE_MESH_H_

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "engine/export/point_cloud.h"

namespace litags {

struct TriangleMesh {
  PointCloud vertices;
  // Corners counterclockwise as seen from the side that cameras were on.
  std::vector<std::array<uint32_t, 3>> triangles;
};

// .ply: coordinates in doubles, colours in bytes, faces as lists of ints.
absl::StatusOr<std::string> EncodeMeshPly(const TriangleMesh& mesh);

// glTF 2.0, one primitive of triangles without a light of its own (KHR_materials_unlit), seen from
// both sides. Colours are linear light in 16 bits, as COLOR_0 has it. Positions are floats; where
// the mesh lies a hundred times its size from the origin, they count from its middle, which is the
// node's translation. Not empty. FAILED_PRECONDITION (EXPORT_OUT_OF_RANGE) beyond 4 GiB.
absl::StatusOr<std::string> EncodeMeshGlb(const TriangleMesh& mesh);

}  // namespace litags

#endif  // LITAGS_ENGINE_EXPORT_TRIANGLE_MESH_H_
