// Inside this module: photos as they are looked at once more, and as one picture.
#ifndef LITAGS_ENGINE_TOOLS_INSPECT_PHOTO_SHEET_H_
#define LITAGS_ENGINE_TOOLS_INSPECT_PHOTO_SHEET_H_

#include <cstddef>
#include <string>

#include "absl/status/status.h"
#include "engine/core/cancel.h"
#include "engine/pipeline/engine.h"
#include "engine/pipeline/photo_screen.h"

namespace litags {

// That the name says PNG or JPEG: INVALID_ARGUMENT (BAD_OUTPUT).
absl::Status CheckSheetPath(const std::string& path);

// Small brightened pictures of the screen's photos, also of those left out: `dir`/NAME.png.
void WriteThumbnails(const ReconstructInput& input, const PhotoScreen& screen, int threads,
                     const std::string& dir, const CancelToken& cancel);

struct SheetPlan {
  size_t columns;
  int cell_width;  // px
};
// Thumbnails of 320 px in six columns; of many photos smaller ones, then more columns: a JPEG holds
// 65,500 px.
SheetPlan PlanSheet(const PhotoScreen& screen);

// Those pictures with their names, and why photos are left out.
absl::Status WritePhotoSheet(const PhotoScreen& screen, const std::string& thumbnails,
                             const std::string& path);

}  // namespace litags

#endif  // LITAGS_ENGINE_TOOLS_INSPECT_PHOTO_SHEET_H_
