#include "engine/export/triangle_mesh.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "absl/strings/str_cat.h"
#include "engine/core/color.h"
#include "engine/export/export_request.h"
#include "engine/export/glb_file.h"
#include "engine/io/byte_reader.h"

namespace litags {
namespace {

constexpr int kTriangles = 4;  // mode of a glTF primitive
// Distance from the origin, in sizes of the mesh, from which floats lose too much: the rule of
// scenes in the coordinates of a map (docs/conventions.md).
constexpr double kFar = 100;

// The middle of the mesh where it lies far from the origin, else the origin.
std::array<double, 3> OriginOf(const PointCloud& points) {
  const Box box = BoundsOf(points);
  std::array<double, 3> middle;
  double size = 0, distance = 0;
  for (int k = 0; k < 3; ++k) {
    middle[k] = (box.min[k] + box.max[k]) / 2;
    size = std::hypot(size, box.max[k] - box.min[k]);
    distance = std::hypot(distance, middle[k]);
  }
  return distance > kFar * size ? middle : std::array<double, 3>{};
}

}  // namespace

absl::StatusOr<std::string> EncodeMeshPly(const TriangleMesh& mesh) {
  std::string out = PlyVertexHeader(mesh.vertices.size());
  absl::StrAppend(&out, "element face ", mesh.triangles.size(),
                  "\nproperty list uchar int vertex_indices\nend_header\n");
  AppendPlyVertices(mesh.vertices, &out);
  for (const auto& triangle : mesh.triangles) {
    AppendNumber<uint8_t>(&out, 3);
    for (const uint32_t corner : triangle) AppendNumber(&out, static_cast<int32_t>(corner));
  }
  return out;
}

absl::StatusOr<std::string> EncodeMeshGlb(const TriangleMesh& mesh) {
  const std::array<double, 3> origin = OriginOf(mesh.vertices);
  GlbBuffer buffer((12 + 8) * mesh.vertices.size() + 12 * mesh.triangles.size());
  buffer.AddPositions(mesh.vertices.size(), [&](size_t i, int k) {
    return static_cast<float>(mesh.vertices[i].xyz[k] - origin[k]);
  });
  // Four numbers, not three: elements begin at multiples of 4 bytes.
  buffer.Add<uint16_t>(kGlbVertices, mesh.vertices.size(), 4, [&](size_t i, int k) {
    return k == 3 ? 65535 : std::lround(65535 * LinearFromSrgb(mesh.vertices[i].rgb[k] / 255.0));
  })["normalized"] = true;
  buffer.Add<uint32_t>(kGlbIndices, 3 * mesh.triangles.size(), 1,
                       [&](size_t i, int) { return mesh.triangles[i / 3][i % 3]; });
  const nlohmann::json primitive = {{"attributes", {{"POSITION", 0}, {"COLOR_0", 1}}},
                                    {"indices", 2},
                                    {"material", 0},
                                    {"mode", kTriangles}};
  // The colours are the light that reaches a camera; programs without the extension show a matt
  // surface of this colour.
  const nlohmann::json material = {
      {"doubleSided", true},
      {"pbrMetallicRoughness", {{"metallicFactor", 0}, {"roughnessFactor", 1}}},
      {"extensions", {{"KHR_materials_unlit", nlohmann::json::object()}}}};
  return EncodeGlbFile(std::move(buffer), primitive, origin,
                       {{"extensionsUsed", nlohmann::json::array({"KHR_materials_unlit"})},
                        {"materials", nlohmann::json::array({material})}});
}

}  // namespace litags
