// One picture that shows many: rows of images with labels, to be judged by eye.
#ifndef LITAGS_ENGINE_TOOLS_CONTACT_SHEET_CONTACT_SHEET_H_
#define LITAGS_ENGINE_TOOLS_CONTACT_SHEET_CONTACT_SHEET_H_

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "engine/core/image.h"

namespace litags {

struct SheetCell {
  enum class Look {
    kPhoto,  // colours as they are; 16-bit and float pictures scaled to the display's range
    kRamp,   // one channel through the viridis colormap, from its 2nd to its 98th percentile
    kGray,   // one channel as grey, same range
  };
  std::string path;  // anything OpenCV reads; empty: an empty cell marked "n/a"
  Look look = Look::kPhoto;
};

struct SheetRow {
  std::string label;  // may have several lines
  std::vector<SheetCell> cells;
};

struct Sheet {
  std::string title;
  std::vector<std::string> columns;  // headings
  std::vector<SheetRow> rows;        // no more cells than columns
  int cell_width = 360;              // px; heights follow from each row's pictures
};

// Parses "photo.jpg", "ramp:depth.pfm", "gray:structure.png" or "-" (no picture).
SheetCell ParseSheetCell(const std::string& text);

// Single-channel values to colours as kRamp does. [1, H, W]; values that are not finite or not
// above 0 are unknown: they are left out of the range and painted black.
ImageU8 ColorRamp(const Planes& values);

// INVALID_ARGUMENT for a sheet with nothing in it or more cells than columns; NOT_FOUND for a
// picture that cannot be read, naming it.
absl::StatusOr<ImageU8> DrawSheet(const Sheet& sheet);

// DrawSheet, written as PNG.
absl::Status WriteSheet(const Sheet& sheet, const std::string& path);

}  // namespace litags

#endif  // LITAGS_ENGINE_TOOLS_CONTACT_SHEET_CONTACT_SHEET_H_
