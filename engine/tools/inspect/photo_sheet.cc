#include "engine/tools/inspect/photo_sheet.h"

#include <algorithm>
#include <cmath>

#include "absl/strings/match.h"
#include "absl/strings/str_cat.h"
#include "engine/core/parallel.h"
#include "engine/io/image_io.h"
#include "engine/tools/contact_sheet/contact_sheet.h"

namespace litags {
namespace {

constexpr int kThumbnail = 320;  // px
constexpr size_t kColumns = 6;
constexpr double kWantedLight = 0.2;  // mean, linear, of a thumbnail
constexpr double kMostGain = 4096;

ImageU8 Thumbnail(const Photo& photo, double light) {
  Photo small = ShrinkToFit(photo, kThumbnail);
  const auto gain = static_cast<float>(light > 0 ? std::min(kMostGain, kWantedLight / light) : 1);
  const LinearTable& linear = LinearTable::Get();
  const SampleTable& sample = SampleTable::Get();
  for (int16_t& s : small.data) s = sample(std::clamp(gain * linear(s), 0.0f, 1.0f));
  return PhotoToU8(small);
}

}  // namespace

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
  Sheet sheet;
  sheet.title = absl::StrCat(screen.photos.size(), " photos would be used (shown as if they had ",
                             "one exposure), ", screen.left_out.size(), " are left out");
  sheet.cell_width = kThumbnail;
  sheet.columns.assign(std::min(kColumns, std::max<size_t>(1, screen.photos.size())), "");
  for (size_t i = 0; i < screen.photos.size(); ++i) {
    if (i % kColumns == 0) sheet.rows.emplace_back();
    SheetRow& row = sheet.rows.back();
    absl::StrAppend(&row.label, row.label.empty() ? "" : "\n", screen.photos[i].name);
    row.cells.push_back({.path = absl::StrCat(thumbnails, "/", screen.photos[i].name, ".png")});
  }
  for (const PhotoLeftOut& photo : screen.left_out) {
    sheet.rows.push_back({absl::StrCat(photo.name, "\nleft out"), {SheetCell()}});
  }
  LITAGS_ASSIGN_OR_RETURN(const ImageU8 picture, DrawSheet(sheet));
  const bool jpeg =
      absl::EndsWithIgnoreCase(path, ".jpg") || absl::EndsWithIgnoreCase(path, ".jpeg");
  return jpeg ? WriteJpeg(path, picture) : WritePng(path, picture);
}

}  // namespace litags
