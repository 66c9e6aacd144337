#include <cmath>
#include <nlohmann/json.hpp>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "engine/core/json_text.h"
#include "engine/export/readers.h"
#include "engine/io/byte_reader.h"

namespace litags {
namespace {

// Calls set(i, k, value) for the floats of an attribute.
template <typename F>
absl::Status ReadFloats(const nlohmann::json& gltf, std::string_view binary,
                        const std::string& attribute, size_t count, int width, F&& set) {
  const auto& attributes = gltf["meshes"][0]["primitives"][0]["attributes"];
  if (!attributes.contains(attribute)) return Corrupt("a .glb without " + attribute);
  const auto& accessor = gltf["accessors"][attributes[attribute].get<size_t>()];
  const auto& view = gltf["bufferViews"][accessor["bufferView"].get<size_t>()];
  ByteReader reader(binary);
  if (accessor["componentType"] != 5126 || accessor["count"] != count ||
      !reader.Skip(view["byteOffset"].get<size_t>())) {
    return Corrupt("a .glb with a wrong " + attribute);
  }
  for (size_t i = 0; i < count; ++i) {
    for (int k = 0; k < width; ++k) {
      float value;
      if (!reader.Read(&value)) return Corrupt("a .glb ends early");
      set(i, k, value);
    }
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<ViewerScene> DecodeGlb(std::string_view bytes) {
  ByteReader reader(bytes);
  uint32_t magic, version, length, size, type;
  std::string_view text, binary;
  if (!reader.Read(&magic) || magic != 0x46546c67 || !reader.Read(&version) ||
      !reader.Read(&length) || length != bytes.size() || !reader.Read(&size) ||
      !reader.Read(&type) || !reader.ReadBytes(size, &text) || !reader.Read(&size) ||
      !reader.Read(&type) || !reader.ReadBytes(size, &binary)) {
    return Corrupt("no .glb");
  }
  const auto gltf = ParseJson(text);
  if (!gltf.is_object() || gltf["extensionsUsed"][0] != "KHR_gaussian_splatting") {
    return Corrupt("a .glb without Gaussians");
  }
  const auto& attributes = gltf["meshes"][0]["primitives"][0]["attributes"];
  const size_t count = gltf["accessors"][attributes["POSITION"].get<size_t>()]["count"];
  ViewerScene scene;
  Splats& splats = scene.splats;
  splats.Resize(count);
  const std::string prefix = "KHR_gaussian_splatting:";
  const auto rows = [&](int row) {
    return [&splats, row](size_t i, int k, float value) { splats.at(i, row + k) = value; };
  };
  LITAGS_RETURN_IF_ERROR(ReadFloats(gltf, binary, "POSITION", count, 3, rows(kMean)));
  LITAGS_RETURN_IF_ERROR(ReadFloats(
      gltf, binary, prefix + "ROTATION", count, 4,
      [&](size_t i, int k, float value) { splats.at(i, kRawQuat + (k + 1) % 4) = value; }));
  LITAGS_RETURN_IF_ERROR(ReadFloats(
      gltf, binary, prefix + "SCALE", count, 3,
      [&](size_t i, int k, float value) { splats.at(i, kLogScale + k) = std::log(value); }));
  LITAGS_RETURN_IF_ERROR(
      ReadFloats(gltf, binary, prefix + "OPACITY", count, 1,
                 [&](size_t i, int, float value) { SetOpacity(&splats, i, value); }));
  scene.sh_degree = -1;
  for (int k = 0; k < ShCount(kMaxShDegree); ++k) {
    const int degree = static_cast<int>(std::sqrt(k));
    const std::string name =
        absl::StrCat(prefix, "SH_DEGREE_", degree, "_COEF_", k - degree * degree);
    if (!attributes.contains(name)) break;
    scene.sh_degree = degree;
    LITAGS_RETURN_IF_ERROR(ReadFloats(gltf, binary, name, count, 3, rows(ShRow(k, 0))));
  }
  const auto& node = gltf["nodes"][0];
  if (node.contains("translation")) {
    scene.origin = node["translation"].get<std::array<double, 3>>();
  }
  return scene;
}

}  // namespace litags
