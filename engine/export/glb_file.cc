#include "engine/export/glb_file.h"

#include <utility>

#include "engine/core/error.h"

namespace litags {
namespace {

void AppendChunk(const char* type, std::string content, char fill, std::string* out) {
  content.append((4 - content.size() % 4) % 4, fill);
  AppendNumber(out, static_cast<uint32_t>(content.size()));
  out->append(type, 4);
  *out += content;
}

}  // namespace

absl::StatusOr<std::string> EncodeGlbFile(GlbBuffer buffer, const nlohmann::json& primitive,
                                          const std::array<double, 3>& translation,
                                          const nlohmann::json& more) {
  if (buffer.bytes_.size() > 0xf0000000) {
    return MakeError(absl::StatusCode::kFailedPrecondition, "EXPORT_OUT_OF_RANGE", "format",
                     "format: the file would have more than 4 GiB; give a smaller max_splats, or "
                     "a smaller crop");
  }
  nlohmann::json node = {{"mesh", 0}, {"name", "scene"}};
  if (translation != std::array<double, 3>{}) node["translation"] = translation;
  nlohmann::json gltf = {
      {"asset", {{"version", "2.0"}, {"generator", "litags"}}},
      {"scene", 0},
      {"scenes", nlohmann::json::array({{{"nodes", nlohmann::json::array({0})}}})},
      {"nodes", nlohmann::json::array({node})},
      {"meshes", nlohmann::json::array({{{"primitives", nlohmann::json::array({primitive})}}})},
      {"buffers", nlohmann::json::array({{{"byteLength", buffer.bytes_.size()}}})},
      {"bufferViews", std::move(buffer.views_)},
      {"accessors", std::move(buffer.accessors_)}};
  gltf.update(more);
  std::string chunks;
  AppendChunk("JSON", gltf.dump(), ' ', &chunks);
  AppendChunk("BIN\0", std::move(buffer.bytes_), '\0', &chunks);
  std::string out = "glTF";
  AppendNumber(&out, uint32_t{2});
  AppendNumber(&out, static_cast<uint32_t>(12 + chunks.size()));
  return out + chunks;
}

}  // namespace litags
