// One line of the table, and the texts that tables are written as.
#ifndef LITAGS_ENGINE_TOOLS_TABLE_ROW_H_
#define LITAGS_ENGINE_TOOLS_TABLE_ROW_H_

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/statusor.h"
#include "engine/tools/table/methods.h"

namespace litags {

// Means over the test views of one scene, light and method.
struct TableRow {
  std::string scene, light, method;
  std::string error;                  // why there is nothing below; empty: there is
  std::optional<double> psnr, ssim;   // no truth photo of any test view, or infinite: none
  std::optional<double> lpips;        // nor without a network
  std::optional<double> psnr_affine;  // after one colour fit for all views; a diagnostic
  double seconds = 0;                 // wall time of the training iterations
  double cpu_seconds = 0;             // of all threads, same iterations and the preparation before
  double enhance_seconds = 0;         // of enhancing photos, or renders of the test views
  int iterations = 0;
  int64_t gaussians = 0;
  int64_t peak_rss_bytes = 0;  // largest resident set of the process that trained or rendered
  int views = 0;               // test views that have a truth photo
  // Along a path (--flicker): mean difference of what two frames show both, [0, 1]; the share of
  // pixels that they do; the frames' standard deviation. None if not asked for.
  std::optional<double> flicker, flicker_share, path_contrast;
  std::string build;  // fingerprint of the program that made it: TRAINED, or TRAINED+SCORED

  bool ok() const { return error.empty(); }
  bool scored() const { return ok() && views > 0; }
  std::string PsnrText() const;  // "25.50"; "infinite" where a render equals its truth
  std::string ToJson() const;    // an object
};

absl::StatusOr<TableRow> ParseTableRow(std::string_view json, std::string_view field);

// The rows as a list, and as lines of comma-separated values under a heading.
std::string TableJson(const std::vector<TableRow>& rows);
std::string TableCsv(const std::vector<TableRow>& rows);

// One table per light in the paper's layout (methods down, scenes and their mean across, groups
// apart, the best in bold), what it cost, which rows other builds made, and what failed. Scenes
// without truth have no column; a line names them. Lines are in the order of `methods`.
std::string TableMarkdown(const std::vector<TableRow>& rows,
                          const std::vector<TableMethod>& methods, const std::string& heading);

}  // namespace litags

#endif  // LITAGS_ENGINE_TOOLS_TABLE_ROW_H_
