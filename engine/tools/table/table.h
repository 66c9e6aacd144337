// The table that methods are compared in: every method on every scene and light, with the same
// code, cameras and budget.
#ifndef LITAGS_ENGINE_TOOLS_TABLE_TABLE_H_
#define LITAGS_ENGINE_TOOLS_TABLE_TABLE_H_

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "engine/enhance/onnx_enhancer.h"
#include "engine/tools/table/methods.h"
#include "engine/tools/table/scene.h"

namespace litags {

struct TableOptions {
  std::vector<TableScene> scenes;
  std::vector<std::string> lights;
  std::vector<TableMethod> methods;
  std::vector<OnnxEnhancerOptions> enhancers;  // beside the built-in ones
  std::string lpips;                           // ONNX file; empty: no LPIPS
  int flicker_frames = 0;                      // of the path that flicker is measured on; 0: not
  std::string colmap = "colmap";
  std::string out;
  std::string settings;  // options of all methods as given by the user; rows of others are not kept
  std::string heading;   // on top of the Markdown file
  bool fresh = false;    // run what is there already, too
  // Started with "--cell SCENE/LIGHT/METHOD" added to it, this runs RunCell.
  std::vector<std::string> program;
};

// Runs every cell that is not there yet, each in a process of its own: its memory is its own, and a
// crash costs one row. Prints a line for each. After each, OUT/table.{json,csv,md} are written;
// after each scene and light OUT/SCENE_LIGHT.png. A cell that fails becomes a row that says why;
// returns how many did. An error only for what stops the whole table, such as a full disk.
absl::StatusOr<int> RunTable(const TableOptions& options);

// One cell in this process: trains (unless that is there), renders, enhances, scores, and leaves a
// row and the pictures in OUT/runs. `cell` is SCENE/LIGHT/METHOD.
absl::Status RunCell(const TableOptions& options, const std::string& cell);

}  // namespace litags

#endif  // LITAGS_ENGINE_TOOLS_TABLE_TABLE_H_
