#include "engine/export/triangle_mesh.h"

#include <gtest/gtest.h>

#include <cmath>

#include "engine/core/color.h"
#include "engine/export/export_test_util.h"

namespace litags {
namespace {

const TriangleMesh kMesh = {
    {{{0, 0, 0}, {0, 128, 255}}, {{1, 0, 0}, {255, 7, 1}}, {{0, 2, 0}, {9, 9, 9}}, {{1, 2, 3}, {}}},
    {{0, 1, 2}, {1, 3, 2}}};

TEST(TriangleMesh, PlyHoldsVerticesAndFaces) {
  const std::string ply = EncodeMeshPly(kMesh).value();
  EXPECT_NE(ply.find("element vertex 4\n"), std::string::npos);
  EXPECT_NE(ply.find("element face 2\nproperty list uchar int vertex_indices\nend_header\n"),
            std::string::npos);
  const size_t body = ply.find("end_header\n") + 11;
  ASSERT_EQ(ply.size(), body + 4 * 27 + 2 * 13);
  EXPECT_EQ(NumberAt<double>(ply, body + 27), 1);
  EXPECT_EQ(NumberAt<uint8_t>(ply, body + 25), 128);
  EXPECT_EQ(NumberAt<uint8_t>(ply, body + 4 * 27), 3);
  EXPECT_EQ(NumberAt<int32_t>(ply, body + 4 * 27 + 13 + 5), 3);
}

TEST(TriangleMesh, GlbHoldsLinearColorsIndicesAndBounds) {
  const auto [gltf, binary] = PartsOf(EncodeMeshGlb(kMesh).value());
  const auto& primitive = gltf["meshes"][0]["primitives"][0];
  EXPECT_EQ(primitive["mode"], 4);
  EXPECT_FALSE(gltf["nodes"][0].contains("translation"));
  const auto& position = gltf["accessors"][primitive["attributes"]["POSITION"].get<int>()];
  EXPECT_EQ(position["min"], (std::vector<double>{0, 0, 0}));
  EXPECT_EQ(position["max"], (std::vector<double>{1, 2, 3}));
  const auto& indices = gltf["accessors"][primitive["indices"].get<int>()];
  EXPECT_EQ(indices["componentType"], 5125);  // UNSIGNED_INT
  EXPECT_EQ(indices["count"], 6);
  const auto& color = gltf["accessors"][primitive["attributes"]["COLOR_0"].get<int>()];
  EXPECT_EQ(color["normalized"], true);
  const size_t at = gltf["bufferViews"][color["bufferView"].get<int>()]["byteOffset"];
  EXPECT_EQ(NumberAt<uint16_t>(binary, at), 0);
  EXPECT_EQ(NumberAt<uint16_t>(binary, at + 2), std::lround(65535 * LinearFromSrgb(128 / 255.0)));
  EXPECT_EQ(NumberAt<uint16_t>(binary, at + 4), 65535);
  EXPECT_EQ(NumberAt<uint16_t>(binary, at + 6), 65535);  // opaque
  const size_t first = gltf["bufferViews"][indices["bufferView"].get<int>()]["byteOffset"];
  EXPECT_EQ(NumberAt<uint32_t>(binary, first + 16), 3u);
}

TEST(TriangleMesh, GlbInTheCoordinatesOfAMapCountsFromItsMiddle) {
  TriangleMesh mesh = kMesh;
  for (ColoredPoint& vertex : mesh.vertices) vertex.xyz[0] += 3500000.125;
  const auto [gltf, binary] = PartsOf(EncodeMeshGlb(mesh).value());
  EXPECT_EQ(gltf["nodes"][0]["translation"], (std::vector<double>{3500000.625, 1, 1.5}));
  EXPECT_EQ(NumberAt<float>(binary, 0), -0.5f);
}

}  // namespace
}  // namespace litags
