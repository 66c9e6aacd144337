#include "engine/tools/contact_sheet/contact_sheet.h"

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_split.h"
#include "engine/core/error.h"
#include "engine/core/quantile.h"
#include "engine/io/depth_io.h"
#include "engine/io/file_util.h"
#include "engine/io/image_header.h"
#include "engine/io/image_io.h"
#include "engine/io/png_codes.h"

namespace litags {
namespace {

constexpr int kGap = 8, kMargin = 16, kTitle = 40, kHeading = 30, kLabel = 76, kLineHeight = 18,
              kCaptionGap = 4;  // px
constexpr double kLabelSize = 0.45;
// RGB; the sheet is drawn in our channel order.
const cv::Scalar kPaper(250, 250, 248), kInk(40, 42, 46), kFaint(150, 152, 156),
    kHole(226, 226, 224);

void Write(cv::Mat& canvas, const std::string& text, cv::Point at, double size,
           const cv::Scalar& color) {
  cv::putText(canvas, PlainText(text), at, cv::FONT_HERSHEY_SIMPLEX, size, color, 1, cv::LINE_AA);
}

cv::Size TextSize(const std::string& text, double size) {
  return cv::getTextSize(PlainText(text), cv::FONT_HERSHEY_SIMPLEX, size, 1, nullptr);
}

// Width of the labels' column: that of the longest line, with room before the pictures; 0 if no row
// has a label.
int LabelWidth(const Sheet& sheet) {
  const auto unlabelled = [](const SheetRow& row) { return row.label.empty(); };
  if (std::all_of(sheet.rows.begin(), sheet.rows.end(), unlabelled)) return 0;
  int width = kLabel;
  for (const SheetRow& row : sheet.rows) {
    for (const absl::string_view line : absl::StrSplit(row.label, '\n')) {
      width = std::max(width, TextSize(std::string(line), kLabelSize).width + kMargin);
    }
  }
  return width;
}

void WriteLabel(cv::Mat& canvas, const std::string& label, cv::Point middle) {
  const std::vector<std::string> lines = absl::StrSplit(label, '\n');
  int y = middle.y - kLineHeight * (static_cast<int>(lines.size()) - 1) / 2;
  for (const std::string& line : lines) {
    Write(canvas, line, {middle.x, y}, kLabelSize, kInk);
    y += kLineHeight;
  }
}

// The text with "..." in place of its middle, if it is wider than this.
std::string Shortened(const std::string& text, int width) {
  std::string shorter = PlainText(text);
  const std::string whole = shorter;
  for (size_t kept = whole.size(); kept > 2 && TextSize(shorter, kLabelSize).width > width;) {
    --kept;
    shorter = whole.substr(0, kept / 2) + "..." + whole.substr(whole.size() - (kept - kept / 2));
  }
  return shorter;
}

// The caption's lines, wrapped between words to this width.
std::vector<std::string> Wrapped(const std::string& caption, int width) {
  std::vector<std::string> lines;
  for (const absl::string_view given : absl::StrSplit(caption, '\n', absl::SkipEmpty())) {
    lines.emplace_back();
    for (const absl::string_view word : absl::StrSplit(given, ' ', absl::SkipEmpty())) {
      const std::string longer = absl::StrCat(lines.back(), lines.back().empty() ? "" : " ", word);
      if (lines.back().empty() || TextSize(longer, kLabelSize).width <= width) {
        lines.back() = longer;
      } else {
        lines.emplace_back(word);
      }
    }
  }
  if (lines.size() > kCaptionLines) {
    lines.resize(kCaptionLines);
    lines.back() += " ...";
  }
  for (std::string& line : lines) line = Shortened(line, width);
  return lines;
}

// The 2nd and 98th percentile of the known values; {0, 1} if there are none.
std::pair<float, float> KnownRange(const Planes& values) {
  std::vector<float> known;
  for (const float v : values.data) {
    if (std::isfinite(v) && v > 0) known.push_back(v);
  }
  if (known.empty()) return {0.0f, 1.0f};
  const float low = QuantileInPlace(known, 0.02), high = QuantileInPlace(known, 0.98);
  return {low, std::max(high, low + 1e-6f)};
}

// Values spread over [0, 255], with unknown ones at 0.
cv::Mat Spread(const Planes& values, cv::Mat* unknown) {
  const auto [low, high] = KnownRange(values);
  cv::Mat out(values.height, values.width, CV_8UC1), holes(out.size(), CV_8UC1, cv::Scalar(0));
  for (size_t i = 0; i < values.plane_size(); ++i) {
    const float v = values.data[i];
    const bool known = std::isfinite(v) && v > 0;
    holes.data[i] = known ? 0 : 255;
    out.data[i] = known ? cv::saturate_cast<uchar>(255 * (v - low) / (high - low)) : uchar{0};
  }
  if (unknown) *unknown = holes;
  return out;
}

cv::Mat Ramp(const Planes& values) {
  cv::Mat unknown, colors;
  cv::applyColorMap(Spread(values, &unknown), colors, cv::COLORMAP_VIRIDIS);
  cv::cvtColor(colors, colors, cv::COLOR_BGR2RGB);
  colors.setTo(cv::Scalar(0, 0, 0), unknown);
  return colors;
}

// One channel of a picture.
struct Values {
  Planes plane;
  bool has_scale = false;  // whether the numbers are those of what is shown, not codes
};

// The first channel of a PNG's codes, of a photo in another format, or a depth map.
absl::StatusOr<Values> ReadValues(const std::string& path) {
  Values values;
  LITAGS_ASSIGN_OR_RETURN(const std::string bytes, ReadFile(path, path, ImageLimits().max_bytes));
  if (IsPng(bytes)) {
    LITAGS_RETURN_IF_ERROR(ReadImageInfo(bytes, path).status());  // checks the limits
    const auto take = [&](const PngShape& shape, int y, const uint16_t* codes) {
      if (y == 0) values.plane = Planes(1, shape.height, shape.width);
      for (int x = 0; x < shape.width; ++x) values.plane.at(0, y, x) = codes[x * shape.channels];
    };
    LITAGS_RETURN_IF_ERROR(ReadPngCodes(bytes, PngChannels::kAll, path, take));
    return values;
  }
  if (absl::StatusOr<Planes> depth = DecodeDepthMap(bytes, path); depth.ok()) {
    return Values{*std::move(depth), /*has_scale=*/true};
  }
  LITAGS_ASSIGN_OR_RETURN(const ImageU8 photo, DecodeImage(bytes, path));
  values.plane = Planes(1, photo.height, photo.width);
  for (size_t i = 0; i < values.plane.data.size(); ++i) values.plane.data[i] = photo.data[3 * i];
  return values;
}

// What the colours of Ramp() mean.
std::string DescribeRamp(const Values& values) {
  if (!values.has_scale) return "";
  const auto [low, high] = KnownRange(values.plane);
  return absl::StrFormat("near %.3g (purple) .. far %.3g (yellow)", low, high);
}

struct LoadedCell {
  cv::Mat picture;  // empty for an empty cell
  std::vector<std::string> caption;
};

// The picture at its own size; a ramp without a caption gets its scale, wrapped to `width`.
absl::Status ReadPicture(const SheetCell& cell, int width, LoadedCell* loaded) {
  if (cell.look == SheetCell::Look::kPhoto) {
    LITAGS_ASSIGN_OR_RETURN(ImageU8 photo, ReadImage(cell.path, cell.path));
    loaded->picture = cv::Mat(photo.height, photo.width, CV_8UC3, photo.data.data()).clone();
    return absl::OkStatus();
  }
  LITAGS_ASSIGN_OR_RETURN(const Values values, ReadValues(cell.path));
  if (cell.look == SheetCell::Look::kRamp) {
    loaded->picture = Ramp(values.plane);
    if (loaded->caption.empty()) loaded->caption = Wrapped(DescribeRamp(values), width);
  } else {
    cv::cvtColor(Spread(values.plane, nullptr), loaded->picture, cv::COLOR_GRAY2RGB);
  }
  return absl::OkStatus();
}

// With a picture `width` wide.
absl::StatusOr<LoadedCell> LoadCell(const SheetCell& cell, int width) {
  LoadedCell loaded = {cv::Mat(), Wrapped(cell.caption, width)};
  if (cell.path.empty()) return loaded;
  cv::Mat& picture = loaded.picture;
  if (const absl::Status status = ReadPicture(cell, width, &loaded); !status.ok()) {
    return MakeError(absl::StatusCode::kNotFound, "CANNOT_READ_IMAGE", cell.path,
                     absl::StrCat(status.message(), "; use - for an empty cell"));
  }
  if (picture.cols == width) return loaded;
  const int height =
      std::max(1, static_cast<int>(std::lround(double(picture.rows) * width / picture.cols)));
  const int filter = width < picture.cols ? cv::INTER_AREA : cv::INTER_LINEAR;
  cv::resize(picture, picture, {width, height}, 0, 0, filter);
  return loaded;
}

struct LoadedRow {
  std::vector<LoadedCell> cells;
  int height = 0;          // of the pictures
  int caption_height = 0;  // below them
};

absl::StatusOr<LoadedRow> LoadRow(const SheetRow& row, int width) {
  LoadedRow out;
  int lines = 0;
  for (const SheetCell& cell : row.cells) {
    LITAGS_ASSIGN_OR_RETURN(LoadedCell loaded, LoadCell(cell, width));
    out.height = std::max(out.height, loaded.picture.rows);
    lines = std::max(lines, static_cast<int>(loaded.caption.size()));
    out.cells.push_back(std::move(loaded));
  }
  if (out.height == 0) out.height = width * 3 / 4;
  out.caption_height = CaptionHeight(lines);
  return out;
}

void DrawCell(cv::Mat& canvas, const LoadedCell& cell, const cv::Rect& place) {
  int bottom = place.br().y;
  if (cell.picture.empty()) {
    cv::rectangle(canvas, place, kHole, cv::FILLED);
    const cv::Size size = TextSize("n/a", 0.5);
    Write(canvas, "n/a", {place.x + (place.width - size.width) / 2, place.y + place.height / 2},
          0.5, kFaint);
  } else {
    cell.picture.copyTo(canvas(cv::Rect(place.tl(), cell.picture.size())));
    bottom = place.y + cell.picture.rows;
  }
  for (const std::string& line : cell.caption) {
    bottom += kLineHeight;
    Write(canvas, line, {place.x, bottom - kCaptionGap}, kLabelSize, kInk);
  }
}

absl::Status Validate(const Sheet& sheet) {
  if (sheet.columns.empty() || sheet.rows.empty()) {
    return InvalidInput("EMPTY_SHEET", "rows",
                        "the sheet has no columns or no rows; give one of each");
  }
  if (sheet.cell_width < 16 || sheet.cell_width > 4096) {
    return InvalidInput(
        "OUT_OF_RANGE", "cell_width",
        absl::StrCat("cell_width: ", sheet.cell_width, " px is outside [16, 4096]"));
  }
  for (const SheetRow& row : sheet.rows) {
    if (row.cells.size() > sheet.columns.size()) {
      return InvalidInput(
          "TOO_MANY_CELLS", "rows",
          absl::StrCat("row \"", row.label, "\" has ", row.cells.size(), " pictures for ",
                       sheet.columns.size(), " columns; name the columns or drop pictures"));
    }
  }
  return absl::OkStatus();
}

absl::StatusOr<ImageU8> Draw(const Sheet& sheet) {
  LITAGS_RETURN_IF_ERROR(Validate(sheet));
  std::vector<LoadedRow> rows;
  const int top = kMargin + (sheet.title.empty() ? 0 : kTitle) + kHeading;
  int height = top;
  for (const SheetRow& row : sheet.rows) {
    LITAGS_ASSIGN_OR_RETURN(LoadedRow loaded, LoadRow(row, sheet.cell_width));
    height += loaded.height + loaded.caption_height + kGap;
    rows.push_back(std::move(loaded));
  }
  const int columns = static_cast<int>(sheet.columns.size()), step = sheet.cell_width + kGap;
  const int left = kMargin + LabelWidth(sheet);
  ImageU8 image(left + columns * step + kMargin - kGap, height - kGap + kMargin);
  cv::Mat canvas(image.height, image.width, CV_8UC3, image.data.data());
  canvas.setTo(kPaper);

  if (!sheet.title.empty()) Write(canvas, sheet.title, {kMargin, kMargin + 20}, 0.65, kInk);
  for (int c = 0; c < columns; ++c) {
    Write(canvas, sheet.columns[c], {left + c * step, top - 10}, 0.5, kInk);
  }
  int y = top;
  for (size_t r = 0; r < rows.size(); ++r) {
    WriteLabel(canvas, sheet.rows[r].label, {kMargin, y + rows[r].height / 2});
    for (size_t c = 0; c < rows[r].cells.size(); ++c) {
      const cv::Rect place(left + static_cast<int>(c) * step, y, sheet.cell_width, rows[r].height);
      DrawCell(canvas, rows[r].cells[c], place);
    }
    y += rows[r].height + rows[r].caption_height + kGap;
  }
  return image;
}

}  // namespace

int CaptionHeight(int lines) { return lines == 0 ? 0 : lines * kLineHeight + kCaptionGap; }

SheetCell ParseSheetCell(const std::string& text) {
  const auto with = [&](const std::string& prefix, SheetCell::Look look) {
    return SheetCell{text.substr(prefix.size()), look, ""};
  };
  if (text == "-") return {};
  if (text.rfind("ramp:", 0) == 0) return with("ramp:", SheetCell::Look::kRamp);
  if (text.rfind("gray:", 0) == 0) return with("gray:", SheetCell::Look::kGray);
  return {text, SheetCell::Look::kPhoto, ""};
}

absl::StatusOr<ImageU8> DrawSheet(const Sheet& sheet) {
  try {
    return Draw(sheet);
  } catch (const cv::Exception& e) {
    return MakeError(absl::StatusCode::kInternal, "OPENCV", "sheet", e.what());
  }
}

absl::Status WriteSheet(const Sheet& sheet, const std::string& path) {
  if (!absl::EndsWithIgnoreCase(path, ".png")) {
    return InvalidInput("CANNOT_WRITE", path,
                        absl::StrCat(path, ": a sheet is a PNG; give a path ending in .png"));
  }
  LITAGS_ASSIGN_OR_RETURN(const ImageU8 image, DrawSheet(sheet));
  return WritePng(path, image);
}

}  // namespace litags
