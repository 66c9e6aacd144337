#include "engine/tools/contact_sheet/contact_sheet.h"

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_split.h"
#include "engine/core/error.h"
#include "engine/core/quantile.h"
#include "engine/io/image_io.h"

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

Planes FirstChannel(const cv::Mat& mat) {
  cv::Mat plane, floats;
  cv::extractChannel(mat, plane, 0);
  plane.convertTo(floats, CV_32F);
  Planes out(1, mat.rows, mat.cols);
  for (int y = 0; y < mat.rows; ++y) {
    std::copy_n(floats.ptr<float>(y), mat.cols, out.data.data() + size_t(y) * mat.cols);
  }
  return out;
}

// 8-bit RGB of a picture that OpenCV alone reads, of any depth; floats are in [0, 1].
cv::Mat EightBits(const cv::Mat& mat) {
  cv::Mat out;
  const double scale = mat.depth() == CV_16U ? 1.0 / 257 : mat.depth() == CV_8U ? 1.0 : 255.0;
  mat.convertTo(out, CV_8U, scale);
  const int conversion = out.channels() == 1   ? cv::COLOR_GRAY2RGB
                         : out.channels() == 4 ? cv::COLOR_BGRA2RGB
                                               : cv::COLOR_BGR2RGB;
  cv::cvtColor(out, out, conversion);
  return out;
}

// Upright, as photos are learnt from; else as OpenCV has it (.pfm, .bmp). Empty: not a picture.
cv::Mat PhotoAt(const std::string& path) {
  absl::StatusOr<ImageU8> photo = ReadImage(path, path);
  if (photo.ok()) {
    return cv::Mat(photo->height, photo->width, CV_8UC3, photo->data.data()).clone();
  }
  const cv::Mat mat = cv::imread(path, cv::IMREAD_UNCHANGED);
  return mat.empty() ? mat : EightBits(mat);
}

// What the colours of Ramp() mean. Integers are of a scale that the file does not tell.
std::string DescribeRamp(const cv::Mat& mat) {
  if (mat.depth() != CV_32F && mat.depth() != CV_64F) return "";
  const auto [low, high] = KnownRange(FirstChannel(mat));
  return absl::StrFormat("near %.3g (purple) .. far %.3g (yellow)", low, high);
}

struct LoadedCell {
  cv::Mat picture;  // empty for an empty cell
  std::vector<std::string> caption;
};

// With a picture `width` wide.
absl::StatusOr<LoadedCell> LoadCell(const SheetCell& cell, int width) {
  LoadedCell loaded = {cv::Mat(), Wrapped(cell.caption, width)};
  if (cell.path.empty()) return loaded;
  const bool is_photo = cell.look == SheetCell::Look::kPhoto;
  const cv::Mat mat = is_photo ? PhotoAt(cell.path) : cv::imread(cell.path, cv::IMREAD_UNCHANGED);
  if (mat.empty()) {
    return MakeError(
        absl::StatusCode::kNotFound, "CANNOT_READ_IMAGE", cell.path,
        absl::StrCat(cell.path, ": missing or not a picture; use - for an empty cell"));
  }
  cv::Mat& picture = loaded.picture;
  switch (cell.look) {
    case SheetCell::Look::kPhoto:
      picture = mat;
      break;
    case SheetCell::Look::kRamp:
      picture = Ramp(FirstChannel(mat));
      if (loaded.caption.empty()) loaded.caption = Wrapped(DescribeRamp(mat), width);
      break;
    case SheetCell::Look::kGray:
      cv::cvtColor(Spread(FirstChannel(mat), nullptr), picture, cv::COLOR_GRAY2RGB);
      break;
  }
  const int height =
      std::max(1, static_cast<int>(std::lround(double(mat.rows) * width / mat.cols)));
  const int filter = width < mat.cols ? cv::INTER_AREA : cv::INTER_LINEAR;
  if (mat.cols != width) cv::resize(picture, picture, {width, height}, 0, 0, filter);
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

ImageU8 ColorRamp(const Planes& values) {
  ImageU8 image(values.width, values.height);
  Ramp(values).copyTo(cv::Mat(image.height, image.width, CV_8UC3, image.data.data()));
  return image;
}

absl::StatusOr<ImageU8> DrawSheet(const Sheet& sheet) {
  try {
    return Draw(sheet);
  } catch (const cv::Exception& e) {
    return MakeError(absl::StatusCode::kInternal, "OPENCV", "sheet", e.what());
  }
}

absl::Status WriteSheet(const Sheet& sheet, const std::string& path) {
  LITAGS_ASSIGN_OR_RETURN(ImageU8 image, DrawSheet(sheet));
  bool written = false;
  try {
    cv::Mat bgr;
    cv::cvtColor(cv::Mat(image.height, image.width, CV_8UC3, image.data.data()), bgr,
                 cv::COLOR_RGB2BGR);
    written = cv::imwrite(path, bgr);
  } catch (const cv::Exception&) {
  }
  if (written) return absl::OkStatus();
  return MakeError(absl::StatusCode::kUnavailable, "CANNOT_WRITE", path,
                   absl::StrCat(path,
                                ": cannot write the sheet; give a path ending in .png in a "
                                "folder that exists"));
}

}  // namespace litags
