#include "engine/tools/inspect/photo_sheet.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_join.h"
#include "engine/core/parallel.h"
#include "engine/io/image_io.h"
#include "engine/tools/contact_sheet/contact_sheet.h"

namespace litags {
namespace {

constexpr int kThumbnail = 320;  // px
constexpr size_t kColumns = 6;   // of many photos a multiple; names beside a row: at most so many
// JPEG ends at 65,500 px. Titles and margins take the rest; rows have a gap.
constexpr double kMostHeight = 65000, kGap = 9;  // px
constexpr double kLeastCell = 200;               // px of width: room for six names beside a row
constexpr double kWantedLight = 0.2;             // mean, linear, of a thumbnail
constexpr double kMostGain = 4096;

ImageU8 Thumbnail(const Photo& photo, double light) {
  Photo small = ShrinkToFit(photo, kThumbnail);
  const auto gain = static_cast<float>(light > 0 ? std::min(kMostGain, kWantedLight / light) : 1);
  const LinearTable& linear = LinearTable::Get();
  const SampleTable& sample = SampleTable::Get();
  for (int16_t& s : small.data) s = sample(std::clamp(gain * linear(s), 0.0f, 1.0f));
  return PhotoToU8(small);
}

// All names, or of many the first and the last.
std::string LabelOf(std::vector<std::string> names) {
  if (names.size() > kColumns) names = {names.front(), absl::StrCat("to ", names.back())};
  return absl::StrJoin(names, "\n");
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
    heights += 0.75 * empty;  // as DrawSheet has it
    rows += empty;
    const double width = (kMostHeight - kGap * rows) / heights;
    if (width < kLeastCell && plan.columns < most) continue;
    plan.cell_width = static_cast<int>(std::clamp<double>(width, 16, kThumbnail));
    plan.columns = std::max<size_t>(1, std::min(plan.columns, most));
    return plan;
  }
}

void WriteThumbnails(const ReconstructInput& input, const PhotoScreen& screen, int threads,
                     const std::string& dir, const CancelToken& cancel) {
  ParallelFor(threads, screen.photos.size(), [&](size_t i, int) {
    if (cancel.IsCancelled()) return;
    const ScreenedPhoto& screened = screen.photos[i];
    const auto photo = ReadPhoto(input.images_dir + "/" + screened.name, screened.name);
    if (!photo.ok()) return;  // it was read a moment ago
    // A sheet without one of them says so.
    WritePng(absl::StrCat(dir, "/", screened.name, ".png"), Thumbnail(*photo, screened.light))
        .IgnoreError();
  });
}

absl::Status WritePhotoSheet(const PhotoScreen& screen, const std::string& thumbnails,
                             const std::string& path) {
  const auto [columns, cell_width] = PlanSheet(screen);
  Sheet sheet;
  sheet.title = absl::StrCat(screen.photos.size(), " photos would be used (shown as if they had ",
                             "one exposure), ", screen.left_out.size(), " are left out");
  sheet.cell_width = cell_width;
  sheet.columns.assign(columns, "");
  for (size_t i = 0; i < screen.photos.size(); i += columns) {
    SheetRow& row = sheet.rows.emplace_back();
    const size_t end = std::min(i + columns, screen.photos.size());
    std::vector<std::string> names;
    for (size_t k = i; k < end; ++k) {
      names.push_back(screen.photos[k].name);
      row.cells.push_back({.path = absl::StrCat(thumbnails, "/", names.back(), ".png")});
    }
    row.label = LabelOf(std::move(names));
  }
  for (size_t i = 0; i < screen.left_out.size(); i += columns) {
    const size_t end = std::min(i + columns, screen.left_out.size());
    std::vector<std::string> names;
    for (size_t k = i; k < end; ++k) names.push_back(screen.left_out[k].name);
    const size_t count = names.size();
    sheet.rows.push_back(
        {absl::StrCat("left out:\n", LabelOf(std::move(names))), std::vector<SheetCell>(count)});
  }
  LITAGS_ASSIGN_OR_RETURN(const ImageU8 picture, DrawSheet(sheet));
  const bool jpeg =
      absl::EndsWithIgnoreCase(path, ".jpg") || absl::EndsWithIgnoreCase(path, ".jpeg");
  return jpeg ? WriteJpeg(path, picture) : WritePng(path, picture);
}

}  // namespace litags
