#ifndef LITAGS_ENGINE_TOOLS_EVALUATION_METHOD_OPTIONS_H_
#define LITAGS_ENGINE_TOOLS_EVALUATION_METHOD_OPTIONS_H_

#include "CLI/App.hpp"
#include "engine/pipeline/engine.h"

namespace litags {

// Adds a command-line option for everything in `options` that shapes the result, and --threads.
// The defaults are those of `options`, which must outlive parsing.
void AddMethodOptions(CLI::App* app, ReconstructOptions* options);

}  // namespace litags

#endif  // LITAGS_ENGINE_TOOLS_EVALUATION_METHOD_OPTIONS_H_
