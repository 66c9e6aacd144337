#include "engine/tools/inspect/photo_sheet.h"

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "engine/core/counted.h"
#include "engine/core/error.h"
#include "engine/core/parallel.h"
#include "engine/io/image_io.h"
#include "engine/tools/contact_sheet/contact_sheet.h"

namespace litags {
namespace {

constexpr int kThumbnail = 320;  // px
constexpr size_t kColumns = 6;   // of many photos a multiple
// JPEG ends at 65,500 px. Titles and margins take the rest; rows have a gap.
constexpr double kMostHeight = 65000, kGap = 9;  // px
constexpr double kLeastCell = 200;               // px of width: room for a name
constexpr double kLeftOutShape = 0.75;           // height by width of their pictures
constexpr double kWantedLight = 0.2;             // mean, linear, of a thumbnail
constexpr double kMostGain = 4096;

ImageU8 Brightened(Photo small, double light) {
  const auto gain = static_cast<float>(light > 0 ? std::min(kMostGain, kWantedLight / light) : 1);
  const LinearTable& linear = LinearTable::Get();
  const SampleTable& sample = SampleTable::Get();
  for (int16_t& s : small.data) s = sample(std::clamp(gain * linear(s), 0.0f, 1.0f));
  return PhotoToU8(small);
}

double MeanLight(const Photo& photo) {
  const LinearTable& linear = LinearTable::Get();
  double sum = 0;
  for (const int16_t s : photo.data) sum += linear(s);
  return photo.data.empty() ? 0 : sum / static_cast<double>(photo.data.size());
}

// Amid grey of one shape: a photo that is left out may be a strip.
ImageU8 Framed(const ImageU8& picture) {
  ImageU8 framed(kThumbnail, static_cast<int>(kThumbnail * kLeftOutShape));
  std::fill(framed.data.begin(), framed.data.end(), uint8_t{226});
  const double scale =
      std::min({1.0, double(framed.width) / picture.width, double(framed.height) / picture.height});
  const ImageU8 inner = ResizeArea(picture, std::max(1, static_cast<int>(picture.width * scale)),
                                   std::max(1, static_cast<int>(picture.height * scale)));
  const int left = (framed.width - inner.width) / 2, top = (framed.height - inner.height) / 2;
  for (int y = 0; y < inner.height; ++y) {
    std::copy_n(inner.pixel(0, y), 3 * inner.width, framed.pixel(left, top + y));
  }
  return framed;
}

// Adds cells, `columns` a row.
void AddRows(std::vector<SheetCell> cells, size_t columns, Sheet* sheet) {
  for (size_t i = 0; i < cells.size(); i += columns) {
    const auto first = cells.begin() + static_cast<ptrdiff_t>(i);
    const auto count = static_cast<ptrdiff_t>(std::min(columns, cells.size() - i));
    sheet->rows.push_back({"", {first, first + count}});
  }
}

}  // namespace

SheetPlan PlanSheet(const PhotoScreen& screen) {
  SheetPlan plan = {kColumns, kThumbnail};
  const size_t most = std::max(screen.photos.size(), screen.left_out.size());
  for (;; plan.columns += kColumns) {
    double heights = 0, rows = 0;  // heights in widths of a cell
    for (size_t i = 0; i < screen.photos.size(); i += plan.columns, ++rows) {
      double row = 0;
      for (size_t k = i; k < std::min(i + plan.columns, screen.photos.size()); ++k) {
        row = std::max(row, double(screen.photos[k].height) / screen.photos[k].width);
      }
      heights += row;
    }
    const size_t empty = (screen.left_out.size() + plan.columns - 1) / plan.columns;
    heights += kLeftOutShape * empty;
    const double captions = CaptionHeight(1) * rows + CaptionHeight(kCaptionLines) * empty;
    rows += empty;
    const double width = (kMostHeight - kGap * rows - captions) / heights;
    if (width < kLeastCell && plan.columns < most) continue;
    plan.cell_width = static_cast<int>(std::clamp<double>(width, 16, kThumbnail));
    plan.columns = std::max<size_t>(1, std::min(plan.columns, most));
    return plan;
  }
}

absl::Status CheckSheetPath(const std::string& path) {
  for (const char* ending : {".png", ".jpg", ".jpeg"}) {
    if (absl::EndsWithIgnoreCase(path, ending)) return absl::OkStatus();
  }
  return InvalidInput("BAD_OUTPUT", "--contact-sheet",
                      absl::StrCat("--contact-sheet ", path, ": the sheet is written as PNG or ",
                                   "JPEG; give a name that ends in .png, .jpg or .jpeg"));
}

void WriteThumbnails(const ReconstructInput& input, const PhotoScreen& screen, int threads,
                     const std::string& dir, const CancelToken& cancel) {
  const size_t used = screen.photos.size();
  ParallelFor(threads, used + screen.left_out.size(), [&](size_t i, int) {
    if (cancel.IsCancelled()) return;
    const std::string& name = i < used ? screen.photos[i].name : screen.left_out[i - used].name;
    const auto photo = ReadPhoto(input.images_dir + "/" + name, name);
    if (!photo.ok()) return;  // left out, or it was read a moment ago
    const Photo small = ShrinkToFit(*photo, kThumbnail);
    const ImageU8 picture = i < used ? Brightened(small, screen.photos[i].light)
                                     : Framed(Brightened(small, MeanLight(small)));
    // A sheet without one of them says so.
    WritePng(absl::StrCat(dir, "/", name, ".png"), picture).IgnoreError();
  });
}

absl::Status WritePhotoSheet(const PhotoScreen& screen, const std::string& thumbnails,
                             const std::string& path) {
  const auto [columns, cell_width] = PlanSheet(screen);
  Sheet sheet;
  sheet.title =
      absl::StrCat(Counted(screen.photos.size(), "photo"), " would be used (shown as if they had ",
                   "one exposure), ", screen.left_out.size(),
                   screen.left_out.size() == 1 ? " is left out" : " are left out");
  sheet.cell_width = cell_width;
  sheet.columns.assign(columns, "");
  std::vector<SheetCell> used, left_out;
  for (const ScreenedPhoto& photo : screen.photos) {
    used.push_back(
        {.path = absl::StrCat(thumbnails, "/", photo.name, ".png"), .caption = photo.name});
  }
  for (const PhotoLeftOut& photo : screen.left_out) {
    const std::string thumbnail = absl::StrCat(thumbnails, "/", photo.name, ".png");
    std::error_code ignored;
    left_out.push_back({.path = std::filesystem::exists(thumbnail, ignored) ? thumbnail : "",
                        .caption = absl::StrCat(
                            photo.name, "\nleft out: ", photo.unreadable ? "" : "it ", photo.why)});
  }
  AddRows(std::move(used), columns, &sheet);
  AddRows(std::move(left_out), columns, &sheet);
  LITAGS_ASSIGN_OR_RETURN(const ImageU8 picture, DrawSheet(sheet));
  const bool jpeg =
      absl::EndsWithIgnoreCase(path, ".jpg") || absl::EndsWithIgnoreCase(path, ".jpeg");
  return jpeg ? WriteJpeg(path, picture) : WritePng(path, picture);
}

}  // namespace litags
