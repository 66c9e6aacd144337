#include "engine/surface/surface_parts.h"

#include <gtest/gtest.h>

namespace litags {
namespace {

// Appends a strip of `squares` squares of side 1, in the plane z.
void AddStrip(int squares, double z, TriangleMesh* mesh) {
  const auto first = static_cast<uint32_t>(mesh->vertices.size());
  for (int i = 0; i <= squares; ++i) {
    for (int j = 0; j < 2; ++j) mesh->vertices.push_back({{double(i), double(j), z}, {}});
  }
  for (int i = 0; i < squares; ++i) {
    const uint32_t at = first + 2 * i;
    mesh->triangles.push_back({at, at + 2, at + 1});
    mesh->triangles.push_back({at + 1, at + 2, at + 3});
  }
}

TEST(SurfaceParts, SmallOnesGo) {
  TriangleMesh mesh;
  AddStrip(2, 0, &mesh);
  AddStrip(5, 1, &mesh);
  AddStrip(3, 2, &mesh);
  mesh.vertices.push_back({{9, 9, 9}, {}});  // of no triangle
  RemoveSmallParts(3, &mesh);
  ASSERT_EQ(mesh.triangles.size(), 10u);
  ASSERT_EQ(mesh.vertices.size(), 12u);
  for (const auto& triangle : mesh.triangles) {
    for (const uint32_t corner : triangle) EXPECT_EQ(mesh.vertices[corner].xyz[2], 1);
  }
  EXPECT_EQ(mesh.triangles[1], (std::array<uint32_t, 3>{1, 2, 3}));
}

TEST(SurfaceParts, OfNothingNothingIsLeft) {
  TriangleMesh mesh;
  RemoveSmallParts(1, &mesh);
  EXPECT_TRUE(mesh.vertices.empty());
}

}  // namespace
}  // namespace litags
