#include "engine/pipeline/black_bars.h"

#include <algorithm>
#include <cstdint>
#include <cstdlib>

#include "absl/strings/str_cat.h"
#include "engine/core/color.h"
#include "engine/core/limits.h"

namespace litags {
namespace {

// 8-bit codes. A sensor's noise is more, unless it is cut off at 0 or smoothed away, which a bar is
// told from by its edge.
constexpr double kFlatLine = 0.3;
constexpr double kDarkLine = 20;  // codes: video's black is 16
constexpr double kOutliers =
    0.002;                        // of a line's pixels, that a bar may have: a watermark's corner
constexpr double kPicture = 0.5;  // of a line's pixels, that differ in a picture

constexpr size_t kBarPhotos = kMinPhotos;  // fewer do not show what they have alike
constexpr int kLeastBar = 4;               // px; thinner ones are rims of cut or turned pictures
constexpr double kMostBars = 0.6;          // of a side; 21:9 within 9:16 leaves 0.24 of it
constexpr int kSoftEdge = 48;              // of a side: a film's edges, scaled and smoothed
constexpr int kBlock = 16;          // px; the one that holds a bar's edge has some of both sides
constexpr float kOfPicture = 0.5F;  // of the level inside: a line of the picture, not of a bar

bool Differ(const int16_t* a, const int16_t* b) {
  for (int c = 0; c < 3; ++c) {
    if (std::abs(a[c] - b[c]) > kFlatLine * kPhotoCode) return true;
  }
  return false;
}

double CodeOf(const int16_t* pixel) { return Luma(pixel) / kPhotoCode; }

// `corner`: of the photo, which is of the bar if there is one.
template <class Pixel>
Line LineOf(int n, const int16_t* corner, const Pixel& pixel) {
  const int16_t* middle = pixel(n / 2);
  int uneven = 0, picture = 0;
  double level = 0;
  for (int i = 0; i < n; ++i) {
    uneven += Differ(pixel(i), middle);
    picture += Differ(pixel(i), corner);
    level += std::abs(CodeOf(pixel(i)) - CodeOf(corner)) / n;
  }
  Line line{.kind = LineKind::kOther, .level = static_cast<float>(level)};
  const bool dark = *std::max_element(middle, middle + 3) <= kDarkLine * kPhotoCode;
  if (picture > kPicture * n) {
    line.kind = LineKind::kPicture;
  } else if (dark && uneven <= kOutliers * n) {
    line.kind = LineKind::kFlat;
  }
  return line;
}

// One side of the lines of each photo, from the picture's edge inwards.
class Side {
 public:
  Side(std::vector<const std::vector<Line>*> photos, bool from_end)
      : photos_(std::move(photos)), from_end_(from_end) {
    for (size_t i = 0; i < photos_.size(); ++i) {
      int run = 0;
      while (run < lines() && At(i, run).kind == LineKind::kFlat) ++run;
      runs_.push_back(run);
    }
  }

  int lines() const { return static_cast<int>(photos_[0]->size()); }
  // Lines that are flat in all photos.
  int bar() const { return *std::min_element(runs_.begin(), runs_.end()); }

  // Whether photo `i` goes from bar to picture within `slack` lines.
  bool EndsAtOnce(size_t i, int slack) const {
    if (runs_[i] > bar() + slack) return false;
    for (int k = runs_[i]; k < std::min(lines(), runs_[i] + slack); ++k) {
      if (At(i, k).kind == LineKind::kPicture) return true;
    }
    return false;
  }

  // The first line of the picture in most photos. Blocks and the interpolation of chroma colour
  // lines of the bar before it, but leave them dark.
  int Picture() const {
    const int inside = bar() + 2 * kBlock;
    if (inside >= lines()) return bar();
    for (int k = bar(); k <= bar() + kBlock; ++k) {
      size_t of_picture = 0;
      for (size_t i = 0; i < photos_.size(); ++i) {
        of_picture += At(i, k).level >= kOfPicture * At(i, inside).level;
      }
      if (2 * of_picture >= photos_.size()) return k;
    }
    return bar();
  }

 private:
  const Line& At(size_t i, int k) const { return (*photos_[i])[from_end_ ? lines() - 1 - k : k]; }

  const std::vector<const std::vector<Line>*> photos_;
  const bool from_end_;
  std::vector<int> runs_;
};

BarFrame::Inside WithoutBars(const std::vector<const std::vector<Line>*>& photos, bool blocks) {
  const Side near(photos, false), far(photos, true);
  const int n = near.lines(), a = near.bar(), b = far.bar();
  const int slack = blocks ? kBlock : std::clamp(n / kSoftEdge, 2, kBlock);
  const BarFrame::Inside all{0, n};
  if (std::min(a, b) < kLeastBar || std::abs(a - b) > slack || a + b > kMostBars * n) {
    return all;
  }
  size_t at_once = 0;
  for (size_t i = 0; i < photos.size(); ++i)
    at_once += near.EndsAtOnce(i, slack) && far.EndsAtOnce(i, slack);
  if (2 * at_once <= photos.size()) return all;
  BarFrame::Inside inside{a, n - b};
  if (blocks) {  // to the grid of blocks
    inside = {(near.Picture() + kBlock - 1) / kBlock * kBlock,
              (n - far.Picture()) / kBlock * kBlock};
  }
  return inside.first < inside.last ? inside : all;
}

std::string Range(const char* what, const BarFrame::Inside& inside, int n) {
  if (inside.first == 0) return "";
  return absl::StrCat(what, " 0 to ", inside.first - 1, " and ", inside.last, " to ", n - 1);
}

}  // namespace

LineKinds KindsOfLines(const Photo& photo) {
  LineKinds kinds;
  const int16_t* corner = photo.pixel(0, 0);
  for (int y = 0; y < photo.height; ++y) {
    kinds.rows.push_back(LineOf(photo.width, corner, [&](int x) { return photo.pixel(x, y); }));
  }
  for (int x = 0; x < photo.width; ++x) {
    kinds.columns.push_back(LineOf(photo.height, corner, [&](int y) { return photo.pixel(x, y); }));
  }
  return kinds;
}

std::optional<BarFrame> FindBars(absl::Span<const LineKinds* const> photos, bool blocks) {
  if (photos.size() < kBarPhotos) return std::nullopt;
  std::vector<const std::vector<Line>*> rows, columns;
  for (const LineKinds* photo : photos) {
    rows.push_back(&photo->rows);
    columns.push_back(&photo->columns);
  }
  const BarFrame frame{WithoutBars(rows, blocks), WithoutBars(columns, blocks)};
  if (frame.rows.first == 0 && frame.columns.first == 0) return std::nullopt;
  return frame;
}

std::string DescribeBars(const BarFrame& frame, int width, int height) {
  const std::string rows = Range("rows", frame.rows, height);
  const std::string columns = Range("columns", frame.columns, width);
  return absl::StrCat(rows, rows.empty() || columns.empty() ? "" : ", ", columns);
}

}  // namespace litags
