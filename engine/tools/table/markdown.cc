// The table as Markdown, in the layout of the paper's Tables 1 and 2.
#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <optional>
#include <set>

#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"
#include "absl/strings/str_replace.h"
#include "engine/tools/table/row.h"

namespace litags {
namespace {

using Rows = std::vector<TableRow>;
using Value = std::function<std::optional<double>(const TableRow&)>;

const char* GroupName(TableMethod::Group group) {
  switch (group) {
    case TableMethod::Group::kReference:
      return "3DGS on normally lit photos, for reference";
    case TableMethod::Group::kVanilla:
      return "3DGS on the photos as they are";
    case TableMethod::Group::kAfter:
      return "3DGS, then enhancement of its renders";
    case TableMethod::Group::kBefore:
      return "Enhancement of the photos, then 3DGS";
    case TableMethod::Group::kChange:
      return "litags with one part changed";
    case TableMethod::Group::kPaperAblation:
      return "litags-paper without parts (the paper's Table 3)";
    case TableMethod::Group::kLita:
      return "End-to-end";
  }
  return "";
}

// Distinct values in the order of their first appearance.
std::vector<std::string> Distinct(const Rows& rows, std::string TableRow::*member) {
  std::vector<std::string> out;
  for (const TableRow& row : rows) {
    if (std::find(out.begin(), out.end(), row.*member) == out.end()) out.push_back(row.*member);
  }
  return out;
}

// The value for one scene, or the mean over all of this light if `scene` is empty; none unless each
// of them has one: a mean over fewer scenes does not compare.
std::optional<double> Over(const Rows& rows, const std::string& light, const std::string& method,
                           const std::string& scene, const Value& value) {
  double sum = 0;
  size_t count = 0;
  std::set<std::string> scenes;
  for (const TableRow& row : rows) {
    if (row.light != light || (!scene.empty() && row.scene != scene)) continue;
    scenes.insert(row.scene);
    if (row.method != method) continue;
    const std::optional<double> v = row.ok() ? value(row) : std::nullopt;
    if (!v.has_value() || !std::isfinite(*v)) return std::nullopt;
    sum += *v;
    ++count;
  }
  if (count == 0 || count < scenes.size()) return std::nullopt;
  return sum / static_cast<double>(count);
}

struct Column {
  std::string title, scene;
  Value value;
  int decimals;
  bool higher_is_better;
  bool needs_truth = false;  // scenes without truth do not count
};

std::vector<Column> ColumnsOf(const std::vector<std::string>& scenes, bool lpips) {
  std::vector<Column> columns;
  const auto add = [&](const std::string& title, const std::string& scene) {
    columns.push_back({title + " PSNR↑", scene, [](const TableRow& r) { return r.psnr; }, 2, true});
    columns.push_back({title + " SSIM↑", scene, [](const TableRow& r) { return r.ssim; }, 3, true});
    if (!lpips) return;
    columns.push_back(
        {title + " LPIPS↓", scene, [](const TableRow& r) { return r.lpips; }, 3, false});
  };
  for (const std::string& scene : scenes) add(scene, scene);
  add("mean", "");
  return columns;
}

std::string Cell(const std::optional<double>& value, int decimals, bool bold) {
  if (!value.has_value()) return " –";
  const std::string text = absl::StrFormat("%.*f", decimals, *value);
  return bold ? absl::StrCat(" **", text, "**") : absl::StrCat(" ", text);
}

// The first two lines of a table; `last` is one more column, or none.
std::string Heading(const std::vector<Column>& columns, const std::string& last) {
  std::string titles = "| Method |", rule = "|---|";
  for (const Column& column : columns) {
    absl::StrAppend(&titles, " ", column.title, " |");
    rule += "---|";
  }
  if (!last.empty()) {
    absl::StrAppend(&titles, " ", last, " |");
    rule += "---|";
  }
  return absl::StrCat(titles, "\n", rule, "\n");
}

// Scenes that methods rendered under this light and that have no truth to score renders against.
std::set<std::string> ScenesWithoutTruth(const Rows& rows, const std::string& light) {
  std::set<std::string> scenes;
  for (const TableRow& row : rows) {
    if (row.light == light && row.ok() && !row.scored()) scenes.insert(row.scene);
  }
  return scenes;
}

Rows Without(const std::set<std::string>& scenes, Rows rows) {
  std::erase_if(rows, [&](const TableRow& row) { return scenes.count(row.scene) > 0; });
  return rows;
}

// Quality of all methods under one light; `rows` are of scenes that have a truth.
std::string QualityTable(const Rows& rows, const std::vector<TableMethod>& methods,
                         const std::string& light) {
  const bool lpips =
      std::any_of(rows.begin(), rows.end(), [](const TableRow& r) { return r.lpips.has_value(); });
  const std::vector<Column> columns = ColumnsOf(Distinct(rows, &TableRow::scene), lpips);
  std::string out = Heading(columns, lpips ? "" : "LPIPS↓");

  // What is in bold: the best of what could be had without normal light.
  std::vector<std::optional<double>> best(columns.size());
  for (size_t c = 0; c < columns.size(); ++c) {
    for (const TableMethod& method : methods) {
      if (method.normal_light) continue;
      const auto v = Over(rows, light, method.name, columns[c].scene, columns[c].value);
      const auto better = [&](double a, double b) {
        return columns[c].higher_is_better ? a > b : a < b;
      };
      if (v.has_value() && (!best[c].has_value() || better(*v, *best[c]))) best[c] = v;
    }
  }
  std::optional<TableMethod::Group> group;
  for (const TableMethod& method : methods) {
    if (group != method.group && *GroupName(method.group) != '\0') {
      absl::StrAppend(&out, "| *", GroupName(method.group), "* |\n");
    }
    group = method.group;
    absl::StrAppend(&out, "| ", method.name, " |");
    for (size_t c = 0; c < columns.size(); ++c) {
      const auto v = Over(rows, light, method.name, columns[c].scene, columns[c].value);
      const bool bold = v.has_value() && !method.normal_light && *v == best[c];
      absl::StrAppend(&out, Cell(v, columns[c].decimals, bold), " |");
    }
    absl::StrAppend(&out, lpips ? "\n" : " no network given |\n");
  }
  return out;
}

// What the methods cost, and PSNR after a colour fit; means over scenes.
std::string CostTable(const Rows& rows, const std::vector<TableMethod>& methods,
                      const std::string& light) {
  std::vector<Column> columns = {
      {"PSNR after one colour fit", "", [](const TableRow& r) { return r.psnr_affine; }, 2, true,
       true},
      {"training, s", "", [](const TableRow& r) { return r.seconds; }, 1, false},
      {"training, CPU s", "", [](const TableRow& r) { return r.cpu_seconds; }, 1, false},
      {"enhancing, s", "", [](const TableRow& r) { return r.enhance_seconds; }, 1, false},
      {"iterations", "", [](const TableRow& r) { return r.iterations; }, 0, false},
      {"Gaussians", "", [](const TableRow& r) { return r.gaussians; }, 0, false},
      {"peak memory, MiB", "", [](const TableRow& r) { return r.peak_rss_bytes / 1048576.0; }, 0,
       false}};
  if (std::any_of(rows.begin(), rows.end(), [](const TableRow& r) { return r.flicker; })) {
    const auto scaled = [](double scale, auto of) {
      return [=](const TableRow& r) -> std::optional<double> {
        if (!r.flicker.has_value()) return std::nullopt;
        return scale * *r.flicker / of(r);
      };
    };
    columns.push_back(
        {"flicker x 1000", "", scaled(1000, [](const TableRow&) { return 1.0; }), 2, false});
    columns.push_back({"flicker / contrast, %", "",
                       scaled(100, [](const TableRow& r) { return r.path_contrast.value_or(0); }),
                       2, false});
  }
  const Rows scored = Without(ScenesWithoutTruth(rows, light), rows);
  std::string out = Heading(columns, "");
  for (const TableMethod& method : methods) {
    absl::StrAppend(&out, "| ", method.name, " |");
    for (const Column& column : columns) {
      const auto v = Over(column.needs_truth ? scored : rows, light, method.name, "", column.value);
      absl::StrAppend(&out, Cell(v, column.decimals, false), " |");
    }
    out += "\n";
  }
  return out;
}

// The rows that other programs made than most; nothing where one made all.
std::string OtherBuilds(const Rows& rows) {
  std::map<std::string, std::vector<std::string>> made;  // by build
  for (const TableRow& row : rows) {
    if (row.ok())
      made[row.build].push_back(absl::StrCat(row.scene, " ", row.light, " ", row.method));
  }
  if (made.size() < 2) return "";
  const auto most = std::max_element(made.begin(), made.end(), [](const auto& a, const auto& b) {
    return a.second.size() < b.second.size();
  });
  std::string out =
      absl::StrCat("\n## Made by other programs\n\nBuild ", most->first,
                   " made the other rows; what the programs differ in may show in the figures. "
                   "--fresh makes all anew.\n\n");
  for (const auto& [build, names] : made) {
    if (build == most->first) continue;
    absl::StrAppend(&out, "- build ", build, ": ", absl::StrJoin(names, ", "), "\n");
  }
  return out;
}

}  // namespace

std::string TableMarkdown(const Rows& rows, const std::vector<TableMethod>& methods,
                          const std::string& heading) {
  std::string out = heading + "\n";
  for (const std::string& light : Distinct(rows, &TableRow::light)) {
    absl::StrAppend(&out, "\n## ", light, "\n\n");
    const std::set<std::string> unknown = ScenesWithoutTruth(rows, light);
    const Rows scored = Without(unknown, rows);
    if (!scored.empty()) absl::StrAppend(&out, QualityTable(scored, methods, light));
    if (!unknown.empty()) {
      absl::StrAppend(&out, scored.empty() ? "" : "\n",
                      "No truth in high/, so no figures: ", absl::StrJoin(unknown, ", "),
                      ". Renders of the test views: runs/SCENE/", light, "/METHOD/test.\n");
    }
    absl::StrAppend(&out, "\nCost and diagnostics, means over scenes:\n\n",
                    CostTable(rows, methods, light));
  }
  absl::StrAppend(&out, OtherBuilds(rows));
  std::string failed;
  for (const TableRow& row : rows) {
    if (row.ok()) continue;
    absl::StrAppend(&failed, "- ", row.scene, " ", row.light, " ", row.method, ": ",
                    absl::StrReplaceAll(row.error, {{"\n", " "}}), "\n");
  }
  if (!failed.empty()) absl::StrAppend(&out, "\n## Failed\n\n", failed);
  return out;
}

}  // namespace litags
