#include "engine/tools/table/sheet.h"

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "engine/core/error.h"
#include "engine/io/picture_io.h"
#include "engine/tools/contact_sheet/contact_sheet.h"
#include "engine/tools/evaluation/evaluation.h"
#include "engine/tools/table/cell.h"

namespace litags {
namespace {

constexpr double kCellHeight = 240, kSheetWidth = 1600;  // px, about
constexpr size_t kMaxViews = 4;

struct SheetView {
  TestView view;
  std::string file;  // its pictures' name, as RunCell writes them
};

// Up to as many views as fit, spread over all.
std::vector<SheetView> Chosen(const std::vector<TestView>& views, size_t fit) {
  const std::vector<std::string> stems = PictureStems(NamesOf(views));
  const size_t count = std::min(views.size(), fit);
  std::vector<SheetView> chosen;
  for (size_t i = 0; i < count; ++i) {
    const size_t at = (2 * i + 1) * views.size() / (2 * count);
    chosen.push_back({views[at], stems[at] + ".png"});
  }
  return chosen;
}

// A row of pictures in `dir`, each beside that of `error_dir`, if there is one.
SheetRow PictureRow(const std::string& label, const std::vector<SheetView>& views,
                    const std::string& dir, const std::string& error_dir) {
  SheetRow row{label, {}};
  for (const SheetView& view : views) {
    const auto cell = [&](const std::string& folder) {
      const std::string path = absl::StrCat(folder, "/", view.file);
      std::error_code ignored;
      const bool there = !folder.empty() && std::filesystem::exists(path, ignored);
      return SheetCell{.path = there ? path : ""};
    };
    row.cells.push_back(cell(dir));
    row.cells.push_back(cell(error_dir));
  }
  return row;
}

// The photos of `dir` as the test cameras see them, into `out`.
absl::Status CopyPhotos(const std::string& dir, const std::vector<SheetView>& views,
                        const std::string& out) {
  std::error_code ignored;  // writing reports what matters
  std::filesystem::create_directories(out, ignored);
  for (const SheetView& view : views) {
    const absl::StatusOr<ImageU8> photo = LoadPicture(dir, view.view);
    if (absl::IsNotFound(photo.status())) continue;  // an empty cell
    LITAGS_RETURN_IF_ERROR(photo.status());
    LITAGS_RETURN_IF_ERROR(WritePng(absl::StrCat(out, "/", view.file), *photo));
  }
  return absl::OkStatus();
}

}  // namespace

absl::Status WriteTableSheet(const TableOptions& options, const TableScene& scene,
                             const std::string& light, const std::vector<TableRow>& rows) {
  LITAGS_ASSIGN_OR_RETURN(const std::vector<TestView> all, scene.TestViews());
  const Camera& first = all[0].view.camera;
  Sheet sheet;
  sheet.cell_width =
      std::clamp(static_cast<int>(std::lround(kCellHeight * first.width / first.height)), 64, 640);
  const auto fit = static_cast<size_t>(kSheetWidth / (2 * sheet.cell_width));
  const std::vector<SheetView> views = Chosen(all, std::clamp(fit, size_t{1}, kMaxViews));

  sheet.title = absl::StrCat(scene.name, ", ", light, ": test views and 4 x |picture - truth|");
  for (const SheetView& view : views) {
    sheet.columns.push_back(view.view.view.name);
    sheet.columns.push_back("error");
  }
  const std::string photos = absl::StrCat(options.out, "/photos/", scene.name);
  LITAGS_RETURN_IF_ERROR(CopyPhotos(scene.PhotosDir(light), views, photos + "/" + light));
  LITAGS_RETURN_IF_ERROR(CopyPhotos(scene.TruthDir(), views, photos + "/truth"));
  sheet.rows.push_back(PictureRow("input", views, photos + "/" + light, ""));
  for (const TableRow& row : rows) {
    if (row.scene != scene.name || row.light != light) continue;
    for (const TableMethod& method : options.methods) {
      if (method.name != row.method) continue;
      const TableCell cell(options, scene, light, method);
      const std::string label =
          row.scored() ? absl::StrFormat("%s\n%s dB, %.3f", row.method, row.PsnrText(),
                                         row.ssim.value_or(NAN))
                       : absl::StrCat(row.method, row.ok() ? "\nno truth" : "\nfailed");
      sheet.rows.push_back(
          row.ok() ? PictureRow(label, views, cell.RunDir() + "/test", cell.RunDir() + "/error")
                   : PictureRow(label, views, "", ""));
    }
  }
  sheet.rows.push_back(PictureRow("truth", views, photos + "/truth", ""));
  return WriteSheet(sheet, absl::StrCat(options.out, "/", scene.name, "_", light, ".png"));
}

}  // namespace litags
