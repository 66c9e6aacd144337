// One picture that shows many: rows of images with labels, to be judged by eye.
#ifndef LITAGS_ENGINE_TOOLS_CONTACT_SHEET_CONTACT_SHEET_H_
#define LITAGS_ENGINE_TOOLS_CONTACT_SHEET_CONTACT_SHEET_H_

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "engine/core/image.h"

namespace litags {

struct SheetCell {
  enum class Look {
    kPhoto,  // colours as they are
    kRamp,  // one channel through the viridis colormap, from its 2nd to its 98th percentile; values
            // that are not finite or not above 0 are unknown, and black
    kGray,  // one channel as grey, same range
  };
  // A photo; for one channel a depth map, too (image_io.h, depth_io.h). Empty: marked "n/a".
  std::string path;
  Look look = Look::kPhoto;
  // Below the picture, words wrapped to its width. A ramp of floating-point values without one gets
  // its scale.
  std::string caption = {};
};

inline constexpr int kCaptionLines = 4;  // at most; the end of a longer one is cut off
int CaptionHeight(int lines);            // px, with its gap

struct SheetRow {
  std::string label;  // may have several lines
  std::vector<SheetCell> cells;
};

struct Sheet {
  std::string title;
  std::vector<std::string> columns;  // headings
  std::vector<SheetRow> rows;        // no more cells than columns; without the last ones: paper
  int cell_width = 360;              // px; heights follow from each row's pictures
};

// Parses "photo.jpg", "ramp:depth.pfm", "gray:structure.png" or "-" (no picture).
SheetCell ParseSheetCell(const std::string& text);

// As much of the text as the font has: ASCII. Letters lose their accents, dashes and quotes become
// plain, and each other character '_'.
std::string PlainText(absl::string_view text);

// INVALID_ARGUMENT for a sheet with nothing in it or more cells than columns; NOT_FOUND for a
// picture that cannot be read, naming it.
absl::StatusOr<ImageU8> DrawSheet(const Sheet& sheet);

// DrawSheet, written as PNG.
absl::Status WriteSheet(const Sheet& sheet, const std::string& path);

}  // namespace litags

#endif  // LITAGS_ENGINE_TOOLS_CONTACT_SHEET_CONTACT_SHEET_H_
