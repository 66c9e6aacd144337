#include <cmath>
#include <cstdlib>
#include <vector>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "engine/export/readers.h"

namespace litags {
namespace {

// The numbers of "NAME = ...", up to the end of the line.
absl::StatusOr<std::vector<float>> Numbers(std::string_view text, std::string_view name) {
  const std::string start = absl::StrCat(" ", std::string(name), " = ");
  const size_t at = text.find(start);
  if (at == std::string_view::npos) return Corrupt("a .usda without " + std::string(name));
  std::vector<float> numbers;
  const std::string line(text.substr(at + start.size(), text.find('\n', at) - at - start.size()));
  for (const char* p = line.c_str(); *p != 0;) {
    char* end;
    const float value = std::strtof(p, &end);
    if (end == p) {
      ++p;  // a bracket or a comma
      continue;
    }
    numbers.push_back(value);
    p = end;
  }
  return numbers;
}

}  // namespace

absl::StatusOr<ViewerScene> DecodeUsda(std::string_view bytes) {
  if (!bytes.starts_with("#usda 1.0\n") ||
      bytes.find("def ParticleField3DGaussianSplat ") == std::string_view::npos) {
    return Corrupt("a .usda without Gaussians");
  }
  LITAGS_ASSIGN_OR_RETURN(const auto positions, Numbers(bytes, "positions"));
  LITAGS_ASSIGN_OR_RETURN(const auto orientations, Numbers(bytes, "orientations"));
  LITAGS_ASSIGN_OR_RETURN(const auto scales, Numbers(bytes, "scales"));
  LITAGS_ASSIGN_OR_RETURN(const auto opacities, Numbers(bytes, "opacities"));
  LITAGS_ASSIGN_OR_RETURN(const auto degree, Numbers(bytes, "radiance:sphericalHarmonicsDegree"));
  LITAGS_ASSIGN_OR_RETURN(const auto coefficients,
                          Numbers(bytes, "radiance:sphericalHarmonicsCoefficients"));
  if (degree.size() != 1) return Corrupt("a .usda without a degree");
  ViewerScene scene;
  scene.sh_degree = static_cast<int>(degree[0]);
  scene.up = bytes.find("upAxis = \"Y\"") != std::string_view::npos ? UpAxis::kY : UpAxis::kZ;
  const size_t n = opacities.size(), per = ShCount(scene.sh_degree);
  if (positions.size() != 3 * n || orientations.size() != 4 * n || scales.size() != 3 * n ||
      coefficients.size() != 3 * n * per) {
    return Corrupt("a .usda whose arrays differ in length");
  }
  scene.splats.Resize(n);
  for (size_t i = 0; i < n; ++i) {
    for (int k = 0; k < 3; ++k) {
      scene.splats.at(i, kMean + k) = positions[3 * i + k];
      scene.splats.at(i, kLogScale + k) = std::log(scales[3 * i + k]);
    }
    for (int k = 0; k < 4; ++k) scene.splats.at(i, kRawQuat + k) = orientations[4 * i + k];
    SetOpacity(&scene.splats, i, opacities[i]);
    for (size_t k = 0; k < per; ++k) {
      for (int c = 0; c < 3; ++c) {
        scene.splats.at(i, ShRow(static_cast<int>(k), c)) = coefficients[3 * (i * per + k) + c];
      }
    }
  }
  return scene;
}

}  // namespace litags
