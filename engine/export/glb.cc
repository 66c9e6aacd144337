// glTF 2.0 binary: one point primitive with KHR_gaussian_splatting, attribute after attribute.
#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <utility>

#include "absl/strings/str_cat.h"
#include "engine/core/color.h"
#include "engine/export/formats.h"
#include "engine/export/glb_file.h"
#include "engine/export/quantize.h"

namespace litags {
namespace {

constexpr int kPoints = 0;  // mode of the primitive
constexpr const char* kExtension = "KHR_gaussian_splatting";

// Returns the attributes of the primitive.
nlohmann::json AddAttributes(const ViewerScene& scene, GlbBuffer* buffer) {
  const Splats& splats = scene.splats;
  nlohmann::json attributes;
  const auto add_floats = [&](const std::string& name, int width, auto&& value) {
    attributes[name] = buffer->num_accessors();
    buffer->Add<float>(kGlbVertices, splats.size(), width, value);
  };
  attributes["POSITION"] = buffer->num_accessors();
  buffer->AddPositions(splats.size(), [&](size_t i, int k) { return splats.at(i, kMean + k); });
  // What programs show that know points only: in linear light, as everywhere in glTF.
  attributes["COLOR_0"] = buffer->num_accessors();
  buffer->Add<uint16_t>(kGlbVertices, splats.size(), 4, [&](size_t i, int k) {
    if (k == 3) return PackUnit(Opacity(splats, i), 16);
    const double srgb = std::clamp(0.5 + kSh0 * splats.at(i, kShDc + k), 0.0, 1.0);
    return PackUnit(LinearFromSrgb(srgb), 16);
  })["normalized"] = true;
  const std::string prefix = absl::StrCat(kExtension, ":");
  add_floats(prefix + "ROTATION", 4, [&](size_t i, int k) {
    return UnitQuat(splats, i)[(k + 1) % 4];  // xyzw
  });
  add_floats(prefix + "SCALE", 3,
             [&](size_t i, int k) { return std::exp(splats.at(i, kLogScale + k)); });
  add_floats(prefix + "OPACITY", 1, [&](size_t i, int) { return Opacity(splats, i); });
  for (int degree = 0; degree <= scene.sh_degree; ++degree) {
    for (int n = 0; n <= 2 * degree; ++n) {
      add_floats(absl::StrCat(prefix, "SH_DEGREE_", degree, "_COEF_", n), 3,
                 [&](size_t i, int c) { return splats.at(i, ShRow(degree * degree + n, c)); });
    }
  }
  return attributes;
}

}  // namespace

absl::StatusOr<std::string> EncodeGlb(const ViewerScene& scene) {
  // Position, colour in bytes, rotation, scale, opacity, harmonics.
  const size_t bytes_each = 12 + 8 + 16 + 12 + 4 + 12 * ShCount(scene.sh_degree);
  GlbBuffer buffer(scene.splats.size() * bytes_each);
  const nlohmann::json primitive = {{"attributes", AddAttributes(scene, &buffer)},
                                    {"mode", kPoints},
                                    {"extensions",
                                     {{kExtension,
                                       {{"kernel", "ellipse"},
                                        {"colorSpace", "srgb_rec709_display"},
                                        {"sortingMethod", "cameraDistance"},
                                        {"projection", "perspective"}}}}}};
  return EncodeGlbFile(std::move(buffer), primitive, scene.origin,
                       {{"extensionsUsed", nlohmann::json::array({kExtension})}});
}

}  // namespace litags
