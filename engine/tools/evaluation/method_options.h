#ifndef LITAGS_ENGINE_TOOLS_EVALUATION_METHOD_OPTIONS_H_
#define LITAGS_ENGINE_TOOLS_EVALUATION_METHOD_OPTIONS_H_

#include <string>
#include <string_view>
#include <vector>

#include "CLI/App.hpp"
#include "absl/status/status.h"
#include "absl/types/span.h"
#include "engine/pipeline/options.h"

namespace litags {

// Adds a command-line option for every field of `options` but those in `without`, with its value as
// the default, and --set NAME=VALUE for constants of the recipe. `options` and `set` must outlive
// parsing.
void AddMethodOptions(CLI::App* app, ReconstructOptions* options, std::vector<std::string>* set,
                      absl::Span<const std::string_view> without = {});

// Sets constants of the options' recipe, "NAME=VALUE" each. INVALID_ARGUMENT on --set.
absl::Status SetConstants(const std::vector<std::string>& set, ReconstructOptions* options);

}  // namespace litags

#endif  // LITAGS_ENGINE_TOOLS_EVALUATION_METHOD_OPTIONS_H_
