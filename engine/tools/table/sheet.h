// The contact sheet of one scene and light.
#ifndef LITAGS_ENGINE_TOOLS_TABLE_SHEET_H_
#define LITAGS_ENGINE_TOOLS_TABLE_SHEET_H_

#include <string>
#include <vector>

#include "absl/status/status.h"
#include "engine/tools/table/row.h"
#include "engine/tools/table/table.h"

namespace litags {

// Draws OUT/SCENE_LIGHT.png from the pictures in OUT/runs: the input, every method of `rows` and
// the truth, each with what differs from the truth, for up to four test views spread over the
// capture. Failed rows have no pictures.
absl::Status WriteTableSheet(const TableOptions& options, const TableScene& scene,
                             const std::string& light, const std::vector<TableRow>& rows);

}  // namespace litags

#endif  // LITAGS_ENGINE_TOOLS_TABLE_SHEET_H_
