#include "engine/export/formats.h"

#include "engine/core/check.h"
#include "engine/io/ply.h"

namespace litags {
namespace {

constexpr FormatInfo kFormats[] = {
    {SceneFormat::kPly, "ply", ".ply", UpAxis::kKeep, false, EncodeStandardPly},
    {SceneFormat::kCompressedPly, "compressed-ply", ".compressed.ply", UpAxis::kKeep, false,
     EncodeCompressedPly},
    {SceneFormat::kSplat, "splat", ".splat", UpAxis::kKeep, false, EncodeSplat},
    {SceneFormat::kSpz, "spz", ".spz", UpAxis::kY, true, EncodeSpz},
    {SceneFormat::kSpzV4, "spz-v4", ".spz", UpAxis::kY, true, EncodeSpzV4},
    {SceneFormat::kSog, "sog", ".sog", UpAxis::kKeep, true, EncodeSog},
    {SceneFormat::kGlb, "glb", ".glb", UpAxis::kY, false, EncodeGlb},
    {SceneFormat::kUsda, "usda", ".usda", UpAxis::kY, false, EncodeUsda},
    {SceneFormat::kColmap, "colmap", ".zip", UpAxis::kKeep, false, EncodeColmap},
    {SceneFormat::kHtml, "html", ".html", UpAxis::kKeep, false, EncodeHtml},
    {SceneFormat::kPoints, "points", ".points.ply", UpAxis::kKeep, false, nullptr, EncodePointsPly},
    {SceneFormat::kLas, "las", ".las", UpAxis::kKeep, false, nullptr, EncodeLas},
    {SceneFormat::kMeshPly, "mesh-ply", ".mesh.ply", UpAxis::kKeep, false, nullptr, nullptr,
     EncodeMeshPly},
    {SceneFormat::kMeshGlb, "mesh-glb", ".mesh.glb", UpAxis::kY, false, nullptr, nullptr,
     EncodeMeshGlb},
};

}  // namespace

absl::Span<const FormatInfo> Formats() {
  return absl::MakeConstSpan(kFormats).first(static_cast<size_t>(SceneFormat::kPoints));
}

const FormatInfo& InfoOf(SceneFormat format) {
  const FormatInfo& info = kFormats[static_cast<size_t>(format)];
  LITAGS_CHECK(info.format == format);
  return info;
}

absl::StatusOr<std::string> EncodeStandardPly(const ViewerScene& scene) {
  return EncodePly(scene.splats, /*lita_attributes=*/false, scene.origin);
}

}  // namespace litags
