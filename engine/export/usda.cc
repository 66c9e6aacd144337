// OpenUSD text: one ParticleField3DGaussianSplat, values activated.
#include <charconv>
#include <cmath>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "engine/export/formats.h"

namespace litags {
namespace {

// Digits that nobody sees the lack of; positions have all of theirs.
constexpr int kDigits = 6;

void AppendText(float value, int digits, std::string* out) {
  char text[32];
  const auto end = digits > 0 ? std::to_chars(text, text + sizeof(text), value,
                                              std::chars_format::general, digits)
                              : std::to_chars(text, text + sizeof(text), value);
  out->append(text, end.ptr);
}

// "(a, b, c)", or "a" alone.
template <typename F>
void AppendTuple(int width, int digits, F&& value, std::string* out) {
  if (width > 1) *out += '(';
  for (int k = 0; k < width; ++k) {
    if (k > 0) *out += ", ";
    AppendText(value(k), digits, out);
  }
  if (width > 1) *out += ')';
}

// `value(i, k)` of element i, k < width.
template <typename F>
void AppendArray(const char* declaration, size_t count, int width, int digits,
                 const CancelToken& cancel, F&& value, std::string* out) {
  absl::StrAppend(out, "    ", declaration, " = [");
  for (size_t i = 0; i < count; ++i) {
    if (i % 4096 == 0 && cancel.IsCancelled()) return;
    if (i > 0) *out += ", ";
    AppendTuple(
        width, digits, [&](int k) { return value(i, k); }, out);
  }
  *out += "]\n";
}

// Corners of what holds the Gaussians to three sigma, first the lower one.
std::array<std::array<float, 3>, 2> Extent(const Splats& splats) {
  std::array<std::array<float, 3>, 2> out{};
  for (size_t i = 0; i < splats.size(); ++i) {
    float radius = 0;
    for (int k = 0; k < 3; ++k) {
      radius = std::max(radius, 3 * std::exp(splats.at(i, kLogScale + k)));
    }
    for (int k = 0; k < 3; ++k) {
      const float mean = splats.at(i, kMean + k);
      out[0][k] = i == 0 ? mean - radius : std::min(out[0][k], mean - radius);
      out[1][k] = i == 0 ? mean + radius : std::max(out[1][k], mean + radius);
    }
  }
  return out;
}

}  // namespace

absl::StatusOr<std::string> EncodeUsda(const ViewerScene& scene) {
  const Splats& splats = scene.splats;
  const CancelToken& cancel = scene.cancel;
  const size_t n = splats.size();
  const int coefficients = ShCount(scene.sh_degree);
  std::string out = absl::StrCat(
      "#usda 1.0\n(\n    defaultPrim = \"Scene\"\n    metersPerUnit = 1\n    upAxis = \"",
      scene.up == UpAxis::kZ ? "Z" : "Y",
      "\"\n)\n\ndef ParticleField3DGaussianSplat \"Scene\"\n{\n");
  // More than numbers take, so that no copy is made; what is not written takes no memory.
  out.reserve(4096 + n * (11 + 3 * coefficients) * 16);
  const auto extent = Extent(splats);
  AppendArray(
      "float3[] extent", 2, 3, 0, cancel, [&](size_t i, int k) { return extent[i][k]; }, &out);
  AppendArray(
      "point3f[] positions", n, 3, 0, cancel,
      [&](size_t i, int k) { return splats.at(i, kMean + k); }, &out);
  AppendArray(
      "quatf[] orientations", n, 4, kDigits, cancel,
      [&](size_t i, int k) { return UnitQuat(splats, i)[k]; }, &out);
  AppendArray(
      "float3[] scales", n, 3, kDigits, cancel,
      [&](size_t i, int k) { return std::exp(splats.at(i, kLogScale + k)); }, &out);
  AppendArray(
      "float[] opacities", n, 1, kDigits, cancel, [&](size_t i, int) { return Opacity(splats, i); },
      &out);
  absl::StrAppend(&out, "    uniform int radiance:sphericalHarmonicsDegree = ", scene.sh_degree,
                  "\n");
  AppendArray(
      "float3[] radiance:sphericalHarmonicsCoefficients", n * coefficients, 3, kDigits, cancel,
      [&](size_t at, int c) {
        return splats.at(at / coefficients, ShRow(static_cast<int>(at % coefficients), c));
      },
      &out);
  LITAGS_RETURN_IF_ERROR(cancel.Check());
  out += "    uniform token sortingModeHint = \"zDepth\"\n";
  if (scene.origin != std::array<double, 3>{}) {
    const std::array<double, 3>& o = scene.origin;
    absl::StrAppend(&out, "    double3 xformOp:translate = (");
    for (int k = 0; k < 3; ++k) {
      char text[400];  // 1e308 in full
      out.append(text,
                 std::to_chars(text, text + sizeof(text), o[k], std::chars_format::fixed).ptr);
      out += k < 2 ? ", " : ")\n";
    }
    out += "    uniform token[] xformOpOrder = [\"xformOp:translate\"]\n";
  }
  out += "}\n";
  return out;
}

}  // namespace litags
