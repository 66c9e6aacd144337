#include "engine/tools/table/table.h"

#include <cmath>
#include <cstdio>
#include <filesystem>
#include <map>
#include <string>
#include <string_view>
#include <utility>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "engine/core/cancel.h"
#include "engine/core/error.h"
#include "engine/core/subprocess.h"
#include "engine/io/file_util.h"
#include "engine/tools/table/cell.h"
#include "engine/tools/table/row.h"
#include "engine/tools/table/sheet.h"

namespace litags {
namespace {

namespace fs = std::filesystem;

absl::Status WriteTexts(const TableOptions& options, const std::vector<TableRow>& rows) {
  const std::string table = options.out + "/table";
  LITAGS_RETURN_IF_ERROR(WriteFileAtomically(table + ".json", TableJson(rows)));
  LITAGS_RETURN_IF_ERROR(WriteFileAtomically(table + ".csv", TableCsv(rows)));
  return WriteFileAtomically(table + ".md", TableMarkdown(rows, options.methods, options.heading));
}

std::string Describe(const TableRow& row) {
  if (!row.ok()) return absl::StrCat("FAILED: ", row.error);
  std::string text = "no truth photo to score against  ";
  if (row.scored()) {
    text = absl::StrFormat("PSNR %s dB  SSIM %.4f  ", row.PsnrText(), row.ssim.value_or(NAN));
  }
  if (row.lpips.has_value()) absl::StrAppendFormat(&text, "LPIPS %.3f  ", *row.lpips);
  absl::StrAppendFormat(&text, "%.1f s  %d Gaussians  %.0f MiB", row.seconds, row.gaussians,
                        row.peak_rss_bytes / 1048576.0);
  return text;
}

class TableRun {
 public:
  explicit TableRun(const TableOptions& options) : options_(options) {}

  absl::StatusOr<int> Run() {
    std::error_code ignored;  // writing reports what matters
    fs::create_directories(options_.out, ignored);
    ForEachCell([&](const TableCell& cell) {
      if (LeftOut(cell)) return;
      ++total_;
      if (!options_.fresh) return;
      fs::remove_all(cell.RunDir(), ignored);
      fs::remove_all(cell.TrainingDir(), ignored);
      fs::remove_all(cell.CamerasDir(), ignored);
    });
    for (const TableScene& scene : options_.scenes) {
      for (const std::string& light : options_.lights) {
        for (const TableMethod& method : options_.methods) {
          const TableCell cell(options_, scene, light, method);
          if (LeftOut(cell)) {
            std::printf("%s: left out, %s has no photos but those of test views\n",
                        cell.Name().c_str(), scene.PhotosDir(cell.photos_light()).c_str());
            continue;
          }
          rows_.push_back(RowOf(cell));
          std::fflush(stdout);
          LITAGS_RETURN_IF_ERROR(WriteTexts(options_, rows_));
        }
        const absl::Status sheet = WriteTableSheet(options_, scene, light, rows_);
        if (!sheet.ok()) {
          std::printf("no contact sheet of %s %s: %s\n", scene.name.c_str(), light.c_str(),
                      std::string(sheet.message()).c_str());
        }
      }
    }
    int failed = 0;
    for (const TableRow& row : rows_) failed += !row.ok();
    return failed;
  }

 private:
  template <class Body>
  void ForEachCell(Body body) const {
    for (const TableScene& scene : options_.scenes) {
      for (const std::string& light : options_.lights) {
        for (const TableMethod& method : options_.methods) {
          body(TableCell(options_, scene, light, method));
        }
      }
    }
  }

  // 3dgs-normal, where real darkness left no normally lit photo to train on.
  static bool LeftOut(const TableCell& cell) {
    return cell.method().normal_light && !cell.scene().TrainingPhotos(cell.photos_light()).ok();
  }

  TableRow RowOf(const TableCell& cell) {
    const std::string name = absl::StrFormat("[%d/%d] %s: ", rows_.size() + 1, total_, cell.Name());
    std::fprintf(stderr, "%s...\n", name.c_str());
    std::string kept_as;
    absl::StatusOr<TableRow> row = [&]() -> absl::StatusOr<TableRow> {
      LITAGS_RETURN_IF_ERROR(PrepareCameras(cell));
      LITAGS_ASSIGN_OR_RETURN(const std::string key, cell.RowKey());
      const std::string path = cell.RunDir() + "/row.json";
      if (auto kept = KeptRow(path, key); kept.has_value() && kept->ok()) {
        kept_as = kept->build == BuildId() ? "kept  " : "kept, made by another build  ";
        return *kept;
      }
      return InChild(cell, path, key);
    }();
    if (!row.ok()) {
      const std::string why(row.status().message());
      row = cell.EmptyRow();
      row->error = why;
    }
    row->light = cell.light();  // 3dgs-normal's row is the same for every light
    std::printf("%s%s%s\n", name.c_str(), kept_as.c_str(), Describe(*row).c_str());
    return *std::move(row);
  }

  // Once for all methods that train on the same photos.
  absl::Status PrepareCameras(const TableCell& cell) {
    const auto known = cameras_.find(cell.CamerasDir());
    if (known != cameras_.end()) return known->second;
    const absl::Status status = cell.scene()
                                    .PrepareCameras(cell.photos_light(), cell.method().options,
                                                    options_.colmap, cell.CamerasDir())
                                    .status();
    cameras_[cell.CamerasDir()] = status;
    return status;
  }

  // Runs the cell in a process of its own.
  absl::StatusOr<TableRow> InChild(const TableCell& cell, const std::string& path,
                                   const std::string& key) const {
    std::error_code ignored;  // the child reports what matters
    fs::create_directories(cell.RunDir(), ignored);
    fs::remove(path, ignored);
    SubprocessOptions child;
    child.args = options_.program;
    child.args.insert(child.args.end(), {"--cell", cell.Name()});
    child.log_path = cell.RunDir() + "/log.txt";
    child.on_line = [](std::string_view line) {
      std::fprintf(stderr, "  %.*s\n", static_cast<int>(line.size()), line.data());
    };
    LITAGS_ASSIGN_OR_RETURN(const SubprocessResult result, RunSubprocess(child, CancelToken()));
    if (auto row = KeptRow(path, key); row.has_value()) return *std::move(row);
    return absl::InternalError(absl::StrCat("the run left no row (exit status ", result.exit_code,
                                            "); see ", child.log_path));
  }

  const TableOptions& options_;
  std::vector<TableRow> rows_;
  std::map<std::string, absl::Status> cameras_;
  int total_ = 0;
};

}  // namespace

absl::StatusOr<int> RunTable(const TableOptions& options) { return TableRun(options).Run(); }

}  // namespace litags
