#include "engine/export/glb_file.h"

#include <utility>

#include "engine/core/error.h"
#include "engine/core/json_text.h"

namespace litags {
namespace {

void Pad(char fill, std::string* chunk) { chunk->append((4 - chunk->size() % 4) % 4, fill); }

void AppendChunkHeader(const char* type, size_t size, std::string* out) {
  AppendNumber(out, static_cast<uint32_t>(size));
  out->append(type, 4);
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
  std::string json = JsonText(gltf);
  Pad(' ', &json);
  // In place: the bytes may be most of what memory there is.
  std::string out = std::move(buffer.bytes_);
  Pad('\0', &out);
  std::string head = "glTF";
  AppendNumber(&head, uint32_t{2});
  AppendNumber(&head, static_cast<uint32_t>(12 + 8 + json.size() + 8 + out.size()));
  AppendChunkHeader("JSON", json.size(), &head);
  head += json;
  AppendChunkHeader("BIN\0", out.size(), &head);
  out.insert(0, head);
  return out;
}

}  // namespace litags
