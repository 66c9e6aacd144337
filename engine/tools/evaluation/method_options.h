#ifndef LITAGS_ENGINE_TOOLS_EVALUATION_METHOD_OPTIONS_H_
#define LITAGS_ENGINE_TOOLS_EVALUATION_METHOD_OPTIONS_H_

#include "CLI/App.hpp"
#include "engine/pipeline/engine.h"

namespace litags {

// The paper's settings, whatever `options` has switched on beyond it: gain on sRGB codes, L1 alone
// in L_exp, 16 channels in a denoiser that runs in every iteration, full size throughout.
ReconstructOptions PaperSettings(ReconstructOptions options);

// Adds a command-line option for everything in `options` that shapes the result, and --threads.
// The defaults are those of `options`, which must outlive parsing. --method litags-paper means
// PaperSettings, changed by the options beside it.
void AddMethodOptions(CLI::App* app, ReconstructOptions* options);

}  // namespace litags

#endif  // LITAGS_ENGINE_TOOLS_EVALUATION_METHOD_OPTIONS_H_
