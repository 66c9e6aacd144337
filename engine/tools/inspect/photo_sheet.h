// Inside this module: photos as they are looked at once more, and as one picture.
#ifndef LITAGS_ENGINE_TOOLS_INSPECT_PHOTO_SHEET_H_
#define LITAGS_ENGINE_TOOLS_INSPECT_PHOTO_SHEET_H_

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "engine/core/cancel.h"
#include "engine/pipeline/engine.h"
#include "engine/pipeline/photo_screen.h"

namespace litags {

// Small brightened pictures of the screen's photos: `dir`/NAME.png.
void WriteThumbnails(const ReconstructInput& input, const PhotoScreen& screen, int threads,
                     const std::string& dir, const CancelToken& cancel);

// Those pictures, and the names of what is left out.
absl::Status WritePhotoSheet(const PhotoScreen& screen, const std::string& thumbnails,
                             const std::string& path);

}  // namespace litags

#endif  // LITAGS_ENGINE_TOOLS_INSPECT_PHOTO_SHEET_H_
