// glTF 2.0 binary: one point primitive with KHR_gaussian_splatting, attribute after attribute.
#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "engine/export/formats.h"
#include "engine/export/quantize.h"
#include "engine/io/byte_reader.h"

namespace litags {
namespace {

constexpr int kUnsignedByte = 5121, kFloat = 5126, kArrayBuffer = 34962, kPoints = 0;
constexpr const char* kExtension = "KHR_gaussian_splatting";

// The binary part, and the JSON that says what is where.
struct Buffer {
  std::string bytes;
  nlohmann::json views = nlohmann::json::array(), accessors = nlohmann::json::array();
  nlohmann::json attributes = nlohmann::json::object();
  size_t count;

  // `value(i, k)` of Gaussian i, k < width, becomes a number of type T.
  template <typename T, typename F>
  nlohmann::json& Add(const std::string& name, int width, F&& value) {
    const char* const types[] = {"SCALAR", "VEC2", "VEC3", "VEC4"};
    const size_t at = bytes.size();
    for (size_t i = 0; i < count; ++i) {
      for (int k = 0; k < width; ++k) AppendNumber(&bytes, static_cast<T>(value(i, k)));
    }
    attributes[name] = accessors.size();
    views.push_back({{"buffer", 0},
                     {"byteOffset", at},
                     {"byteLength", bytes.size() - at},
                     {"target", kArrayBuffer}});
    accessors.push_back({{"bufferView", views.size() - 1},
                         {"componentType", sizeof(T) == 1 ? kUnsignedByte : kFloat},
                         {"count", count},
                         {"type", types[width - 1]}});
    return accessors.back();
  }
};

void AddAttributes(const ViewerScene& scene, Buffer* buffer) {
  const Splats& splats = scene.splats;
  const auto mean = [&](size_t i, int k) { return splats.at(i, kMean + k); };
  nlohmann::json& position = buffer->Add<float>("POSITION", 3, mean);
  std::array<float, 3> min, max;
  for (int k = 0; k < 3; ++k) {
    min[k] = max[k] = mean(0, k);
    for (size_t i = 1; i < splats.size(); ++i) {
      min[k] = std::min(min[k], mean(i, k));
      max[k] = std::max(max[k], mean(i, k));
    }
  }
  position["min"] = min;
  position["max"] = max;
  // What programs show that know points only.
  buffer->Add<uint8_t>("COLOR_0", 4, [&](size_t i, int k) {
    return k < 3 ? PackByte(255 * (0.5 + kSh0 * splats.at(i, kShDc + k)))
                 : PackByte(255 * Opacity(splats, i));
  })["normalized"] = true;
  const std::string prefix = absl::StrCat(kExtension, ":");
  buffer->Add<float>(prefix + "ROTATION", 4, [&](size_t i, int k) {
    return UnitQuat(splats, i)[(k + 1) % 4];  // xyzw
  });
  buffer->Add<float>(prefix + "SCALE", 3,
                     [&](size_t i, int k) { return std::exp(splats.at(i, kLogScale + k)); });
  buffer->Add<float>(prefix + "OPACITY", 1, [&](size_t i, int) { return Opacity(splats, i); });
  for (int degree = 0; degree <= scene.sh_degree; ++degree) {
    for (int n = 0; n <= 2 * degree; ++n) {
      buffer->Add<float>(
          absl::StrCat(prefix, "SH_DEGREE_", degree, "_COEF_", n), 3,
          [&](size_t i, int c) { return splats.at(i, ShRow(degree * degree + n, c)); });
    }
  }
}

void AppendChunk(const char* type, std::string content, char fill, std::string* out) {
  content.append((4 - content.size() % 4) % 4, fill);
  AppendNumber(out, static_cast<uint32_t>(content.size()));
  out->append(type, 4);
  *out += content;
}

}  // namespace

absl::StatusOr<std::string> EncodeGlb(const ViewerScene& scene) {
  Buffer buffer;
  buffer.count = scene.splats.size();
  AddAttributes(scene, &buffer);
  if (buffer.bytes.size() > 0xf0000000) {
    return MakeError(absl::StatusCode::kFailedPrecondition, "EXPORT_OUT_OF_RANGE", "format",
                     "format: the file would have more than 4 GiB; give a smaller max_splats");
  }
  nlohmann::json node = {{"mesh", 0}, {"name", "scene"}};
  if (scene.origin != std::array<double, 3>{}) node["translation"] = scene.origin;
  const nlohmann::json primitive = {{"attributes", buffer.attributes},
                                    {"mode", kPoints},
                                    {"extensions",
                                     {{kExtension,
                                       {{"kernel", "ellipse"},
                                        {"colorSpace", "srgb_rec709_display"},
                                        {"sortingMethod", "cameraDistance"},
                                        {"projection", "perspective"}}}}}};
  const nlohmann::json gltf = {
      {"asset", {{"version", "2.0"}, {"generator", "litags"}}},
      {"extensionsUsed", nlohmann::json::array({kExtension})},
      {"scene", 0},
      {"scenes", nlohmann::json::array({{{"nodes", nlohmann::json::array({0})}}})},
      {"nodes", nlohmann::json::array({node})},
      {"meshes", nlohmann::json::array({{{"primitives", nlohmann::json::array({primitive})}}})},
      {"buffers", nlohmann::json::array({{{"byteLength", buffer.bytes.size()}}})},
      {"bufferViews", buffer.views},
      {"accessors", buffer.accessors}};
  std::string chunks;
  AppendChunk("JSON", gltf.dump(), ' ', &chunks);
  AppendChunk("BIN\0", std::move(buffer.bytes), '\0', &chunks);
  std::string out = "glTF";
  AppendNumber(&out, uint32_t{2});
  AppendNumber(&out, static_cast<uint32_t>(12 + chunks.size()));
  return out + chunks;
}

}  // namespace litags
