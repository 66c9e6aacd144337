// litags-sheet: rows of pictures with labels in one PNG.
#include <CLI/CLI.hpp>
#include <string>
#include <vector>

#include "engine/tools/contact_sheet/contact_sheet.h"
#include "engine/tools/failure/failure.h"
#include "proto/arguments/arguments.h"

namespace {

int Run(int argc, char** argv) {
  CLI::App app(
      "Draws rows of pictures with labels into one PNG.\n"
      "A picture is PATH, ramp:PATH (one channel in colours), gray:PATH or - (none).",
      "litags-sheet");
  litags::Sheet sheet;
  std::string out;
  std::vector<std::vector<std::string>> rows;
  app.add_option("-o,--output,--out", out, "PNG to write")->required();
  app.add_option("--title", sheet.title, "Line above the pictures");
  app.add_option("--columns", sheet.columns, "Headings, separated by commas")
      ->delimiter(',')
      ->required();
  app.add_option("--row", rows, "A row: LABEL PICTURE...; may be repeated")->required();
  app.add_option("--cell-width", sheet.cell_width, "Width of a picture, px")->capture_default_str();
  if (const auto exit = litags::ParseArguments(app, argc, argv)) return *exit;

  for (const std::vector<std::string>& words : rows) {
    litags::SheetRow row;
    row.label = words.at(0);
    for (size_t i = 1; i < words.size(); ++i) {
      row.cells.push_back(litags::ParseSheetCell(words[i]));
    }
    sheet.rows.push_back(std::move(row));
  }
  const absl::Status status = litags::WriteSheet(sheet, out);
  if (!status.ok()) litags::PrintError("litags-sheet", status);
  return litags::ExitCodeOf(status);
}

}  // namespace

int main(int argc, char** argv) {
  return litags::RunProgram("litags-sheet", [&] { return Run(argc, argv); });
}
