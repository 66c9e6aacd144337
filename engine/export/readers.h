// Readers of the formats that the export writes: enough to measure and test what was written, with
// few words about what is wrong with other files.
#ifndef LITAGS_ENGINE_EXPORT_READERS_H_
#define LITAGS_ENGINE_EXPORT_READERS_H_

#include <string>
#include <string_view>

#include "absl/status/statusor.h"
#include "engine/export/viewer_scene.h"

namespace litags {

// Gaussians of a file in one of the formats but COLMAP's; axes are the file's. DATA_LOSS if it does
// not hold them.
absl::StatusOr<ViewerScene> ReadExported(SceneFormat format, const std::string& bytes);

absl::StatusOr<ViewerScene> DecodeCompressedPly(std::string_view bytes);
absl::StatusOr<ViewerScene> DecodeSplat(std::string_view bytes);
absl::StatusOr<ViewerScene> DecodeSpz(std::string_view bytes);  // version 3 or 4
absl::StatusOr<ViewerScene> DecodeSog(std::string_view bytes);
absl::StatusOr<ViewerScene> DecodeGlb(std::string_view bytes);
absl::StatusOr<ViewerScene> DecodeUsda(std::string_view bytes);
absl::StatusOr<ViewerScene> DecodeHtml(std::string_view bytes);

// A stored file of a ZIP file; empty if there is none of this name.
std::string_view StoredFile(std::string_view zip, std::string_view name);

// Opacity, finite for 0 and 1 too, and unit quaternion (wxyz) of Gaussian i as rows.
void SetOpacity(Splats* splats, size_t i, double opacity);
void SetQuat(Splats* splats, size_t i, const std::array<float, 4>& quat);

inline absl::Status Corrupt(std::string_view what) {
  return absl::DataLossError(absl::string_view(what.data(), what.size()));
}

}  // namespace litags

#endif  // LITAGS_ENGINE_EXPORT_READERS_H_
