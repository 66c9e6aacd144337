// Finds letterbox and pillarbox bars.
#ifndef LITAGS_ENGINE_PIPELINE_BLACK_BARS_H_
#define LITAGS_ENGINE_PIPELINE_BLACK_BARS_H_

#include <optional>
#include <string>
#include <vector>

#include "absl/types/span.h"
#include "engine/core/photo.h"

namespace litags {

// What the rows and columns of a photo are like.
enum class LineKind : char {
  kOther,
  kFlat,     // dark and of one colour from end to end, as a bar's
  kPicture,  // most pixels have another colour than the photo's corner
};
struct Line {
  LineKind kind = LineKind::kOther;
  float level = 0;  // mean distance of its luma from the corner's, codes
};
struct LineKinds {
  std::vector<Line> rows, columns;
};
LineKinds KindsOfLines(const Photo& photo);

// The lines that are no bar: the first, and the last + 1.
struct BarFrame {
  struct Inside {
    int first = 0, last = 0;
  };
  Inside rows, columns;
};

// The bars that all photos of one size share. A bar comes with another one of its width across the
// picture, ends at the same line in most photos, and the picture begins there at once: a black sky
// or floor, the rim of a torch's light and photos of mean code 2 have none of this. Where the
// format has `blocks`, as JPEG, what they mix of bar and picture is taken as bar. nullopt: there
// are none.
std::optional<BarFrame> FindBars(absl::Span<const LineKinds* const> photos, bool blocks);

// "rows 0 to 6 and rows 41 to 47", and columns.
std::string DescribeBars(const BarFrame& frame, int width, int height);

}  // namespace litags

#endif  // LITAGS_ENGINE_PIPELINE_BLACK_BARS_H_
