// One scene, light and method of the table: where its files are, and what they were made from.
#ifndef LITAGS_ENGINE_TOOLS_TABLE_CELL_H_
#define LITAGS_ENGINE_TOOLS_TABLE_CELL_H_

#include <optional>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "engine/enhance/enhance.h"
#include "engine/tools/table/row.h"
#include "engine/tools/table/table.h"

namespace litags {

class TableCell {
 public:
  TableCell(const TableOptions& options, const TableScene& scene, std::string light,
            const TableMethod& method)
      : options_(options), scene_(scene), light_(std::move(light)), method_(method) {}

  const TableScene& scene() const { return scene_; }
  const TableMethod& method() const { return method_; }
  const std::string& light() const { return light_; }
  // The light of the photos that are trained on.
  std::string photos_light() const { return method_.normal_light ? "high" : light_; }
  std::string Name() const;  // SCENE/LIGHT/METHOD

  // OUT/runs/SCENE/LIGHT/METHOD: test/ and error/ with pictures, row.json, log.txt.
  std::string RunDir() const { return RunDirOf(method_.name); }
  // The same of the method whose scene is rendered: scene.litags, training.json.
  std::string TrainingDir() const { return RunDirOf(method_.trained_as); }
  // OUT/cameras/SCENE/LIGHT: shared by all methods that train on this light.
  std::string CamerasDir() const;
  // Masks of the training photos: CamerasDir()/masks, or empty if there are none.
  std::string MasksDir() const;

  // A row with nothing in it but what it is of, and the program.
  TableRow EmptyRow() const;

  // What the trained scene and the row were made from; different inputs give different texts.
  absl::StatusOr<std::string> TrainingKey() const;
  absl::StatusOr<std::string> RowKey() const;

  // The enhancer called `name`.
  absl::StatusOr<Enhancer> MakeEnhancer(const std::string& name) const;

 private:
  std::string RunDirOf(const std::string& method) const;
  std::string EnhancerKey(const std::string& name) const;

  const TableOptions& options_;
  const TableScene& scene_;
  std::string light_;
  const TableMethod& method_;
};

// A row kept in a file together with its key.
absl::Status KeepRow(const std::string& path, const std::string& key, const TableRow& row);
// The row, if the file is there, whole, and has this key.
std::optional<TableRow> KeptRow(const std::string& path, const std::string& key);

// A fingerprint of this program.
std::string BuildId();

}  // namespace litags

#endif  // LITAGS_ENGINE_TOOLS_TABLE_CELL_H_
