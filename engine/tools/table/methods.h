// The methods of the table, by name: ours, the paper's, its ablations, and 3DGS with enhancers.
#ifndef LITAGS_ENGINE_TOOLS_TABLE_METHODS_H_
#define LITAGS_ENGINE_TOOLS_TABLE_METHODS_H_

#include <string>
#include <vector>

#include "absl/status/statusor.h"
#include "engine/pipeline/options.h"

namespace litags {

struct TableMethod {
  enum class Group { kReference, kVanilla, kAfter, kBefore, kChange, kPaperAblation, kLita };

  std::string name;
  Group group = Group::kLita;
  ReconstructOptions options;
  bool normal_light = false;  // trains on the normally lit photos, for reference
  std::string before;         // enhancer of the photos; empty: none
  std::string after;          // enhancer of the renders; empty: none
  std::string trained_as;     // the method whose scene is rendered: itself, unless `after` is set
};

// Methods that are no 3DGS: litags with one change, the paper's Table 3, litags-paper, litags.
std::vector<std::string> LitaMethods();

// Every method, in the order of the paper's tables: 3dgs-normal, 3dgs, 3dgs+E, E+3dgs, and
// LitaMethods().
std::vector<std::string> AllMethods(const std::vector<std::string>& enhancers);

// The method called `name`; what its name does not say is as in `base`, and as `set` (of --set)
// has it. INVALID_ARGUMENT (UNKNOWN_METHOD) with a list of what there is; errors of SetConstants.
absl::StatusOr<TableMethod> ParseMethod(const std::string& name, const ReconstructOptions& base,
                                        const std::vector<std::string>& enhancers,
                                        const std::vector<std::string>& set = {});

}  // namespace litags

#endif  // LITAGS_ENGINE_TOOLS_TABLE_METHODS_H_
