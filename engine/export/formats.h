// The file formats of scenes: one table, one source file each.
#ifndef LITAGS_ENGINE_EXPORT_FORMATS_H_
#define LITAGS_ENGINE_EXPORT_FORMATS_H_

#include <cstddef>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/types/span.h"
#include "engine/export/export_request.h"
#include "engine/export/point_cloud.h"
#include "engine/export/triangle_mesh.h"
#include "engine/export/viewer_scene.h"

namespace litags {

struct FormatInfo {
  SceneFormat format;
  const char* name;    // on command lines
  const char* ending;  // of a file's name
  UpAxis up;           // what it is turned to unless asked; kKeep: it is not turned
  bool has_antialiased_tag;
  float viewers_add;  // px^2, to a Gaussian's 2D covariance: those of scenes without that tag
  // The file's bytes. FAILED_PRECONDITION (EXPORT_OUT_OF_RANGE) if the format cannot hold them.
  // Of these three functions, two are null.
  absl::StatusOr<std::string> (*encode)(const ViewerScene& scene);
  std::string (*encode_points)(const PointCloud& points) = nullptr;
  absl::StatusOr<std::string> (*encode_mesh)(const TriangleMesh& mesh) = nullptr;
};

// Those of Gaussians, in the order of SceneFormat.
absl::Span<const FormatInfo> Formats();
// Whether it is a value of SceneFormat, as InfoOf needs it.
bool IsFormat(SceneFormat format);
const FormatInfo& InfoOf(SceneFormat format);

absl::StatusOr<std::string> EncodeStandardPly(const ViewerScene& scene);

// PlayCanvas: chunks of 256 neighbours (NearOrder), 16 bytes each and a byte for each coefficient
// of colour. The origin and the antialiased tag are comments of the header, "origin X Y Z" and
// "antialiased".
absl::StatusOr<std::string> EncodeCompressedPly(const ViewerScene& scene);

// antimatter15/splat: 32 bytes each, the most visible first; one colour from all sides.
absl::StatusOr<std::string> EncodeSplat(const ViewerScene& scene);

// Niantic: attribute after attribute in 8 to 24 bits, version 3 gzip, 4 zstd. CheckSpzCount is of
// version 3.
absl::Status CheckSpzCount(size_t gaussians);
absl::StatusOr<std::string> EncodeSpz(const ViewerScene& scene);
absl::StatusOr<std::string> EncodeSpzV4(const ViewerScene& scene);

// PlayCanvas, version 2: lossless WebP pictures and meta.json in a ZIP file.
absl::StatusOr<std::string> EncodeSog(const ViewerScene& scene);

// glTF with KHR_gaussian_splatting, floats.
absl::StatusOr<std::string> EncodeGlb(const ViewerScene& scene);

// OpenUSD 26.03 and later: ParticleField3DGaussianSplat as text.
absl::StatusOr<std::string> EncodeUsda(const ViewerScene& scene);

// COLMAP's model of the photos' cameras with the Gaussians' centres as points, in a ZIP file.
absl::StatusOr<std::string> EncodeColmap(const ViewerScene& scene);

// A page that shows the scene by WebGL and loads nothing. FAILED_PRECONDITION (EXPORT_NOT_BUILT)
// where the program was built without the viewer.
absl::StatusOr<std::string> EncodeHtml(const ViewerScene& scene);

}  // namespace litags

#endif  // LITAGS_ENGINE_EXPORT_FORMATS_H_
