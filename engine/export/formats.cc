#include "engine/export/formats.h"

#include <iterator>

#include "engine/core/check.h"
#include "engine/io/ply.h"
#include "engine/render/constants.h"

namespace litags {
namespace {

// PlayCanvas adds 0.3 to covariances in half pixels (gsplatCorner of its engine 2.23).
constexpr float kPlayCanvasAdds = 0.3f / 4;

constexpr FormatInfo kFormats[] = {
    {SceneFormat::kPly, "ply", ".ply", UpAxis::kKeep, false, kEps2d, EncodeStandardPly},
    {SceneFormat::kCompressedPly, "compressed-ply", ".compressed.ply", UpAxis::kKeep, true,
     kPlayCanvasAdds, EncodeCompressedPly},
    {SceneFormat::kSplat, "splat", ".splat", UpAxis::kKeep, false, kEps2d, EncodeSplat},
    {SceneFormat::kSpz, "spz", ".spz", UpAxis::kY, true, kEps2d, EncodeSpz},
    {SceneFormat::kSpzV4, "spz-v4", ".spz", UpAxis::kY, true, kEps2d, EncodeSpzV4},
    {SceneFormat::kSog, "sog", ".sog", UpAxis::kKeep, true, kPlayCanvasAdds, EncodeSog},
    {SceneFormat::kGlb, "glb", ".glb", UpAxis::kY, false, kEps2d, EncodeGlb},
    {SceneFormat::kUsda, "usda", ".usda", UpAxis::kY, false, kEps2d, EncodeUsda},
    {SceneFormat::kColmap, "colmap", ".zip", UpAxis::kKeep, false, kEps2d, EncodeColmap},
    {SceneFormat::kHtml, "html", ".html", UpAxis::kKeep, true, kEps2d, EncodeHtml},
    {SceneFormat::kPoints, "points", ".points.ply", UpAxis::kKeep, false, kEps2d, nullptr,
     EncodePointsPly},
    {SceneFormat::kLas, "las", ".las", UpAxis::kKeep, false, kEps2d, nullptr, EncodeLas},
    {SceneFormat::kMeshPly, "mesh-ply", ".mesh.ply", UpAxis::kKeep, false, kEps2d, nullptr, nullptr,
     EncodeMeshPly},
    {SceneFormat::kMeshGlb, "mesh-glb", ".mesh.glb", UpAxis::kY, false, kEps2d, nullptr, nullptr,
     EncodeMeshGlb},
};

}  // namespace

absl::Span<const FormatInfo> Formats() {
  return absl::MakeConstSpan(kFormats).first(static_cast<size_t>(SceneFormat::kPoints));
}

bool IsFormat(SceneFormat format) { return static_cast<size_t>(format) < std::size(kFormats); }

const FormatInfo& InfoOf(SceneFormat format) {
  LITAGS_CHECK(IsFormat(format));
  const FormatInfo& info = kFormats[static_cast<size_t>(format)];
  LITAGS_CHECK(info.format == format);
  return info;
}

absl::StatusOr<std::string> EncodeStandardPly(const ViewerScene& scene) {
  return EncodePly(scene.splats, /*lita_attributes=*/false, scene.origin);
}

}  // namespace litags
