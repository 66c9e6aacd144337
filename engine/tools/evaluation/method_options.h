#ifndef LITAGS_ENGINE_TOOLS_EVALUATION_METHOD_OPTIONS_H_
#define LITAGS_ENGINE_TOOLS_EVALUATION_METHOD_OPTIONS_H_

#include "CLI/App.hpp"
#include "engine/pipeline/engine.h"

namespace litags {

// The paper's settings, whatever `options` has switched on beyond it: gain on sRGB codes, L1 alone
// in L_exp, 16 channels in a denoiser that runs in every iteration, full size throughout.
ReconstructOptions PaperSettings(ReconstructOptions options);

// One change each, for ablations. They apply to our settings and to the paper's; what a change does
// not name stays as it is in `options`.
// Without the PDM and its loss L_de: R = R_0.
ReconstructOptions WithoutPdm(ReconstructOptions options);
// Without L_depth, and without the points of stereo depth that our settings start from.
ReconstructOptions WithoutDepth(ReconstructOptions options);
// Without L_prior. In our settings it trains its own map only, so that pictures stay the same.
ReconstructOptions WithoutPrior(ReconstructOptions options);
// Without the filter that our settings have in place of the PDM.
ReconstructOptions WithoutNoiseFilter(ReconstructOptions options);
// With the PDM, beside the noise filter if `options` have one.
ReconstructOptions WithPdm(ReconstructOptions options);
// L_prior moves Gaussians, as in the paper.
ReconstructOptions WithPriorGeometry(ReconstructOptions options);

// Adds a command-line option for everything in `options` that shapes the result, and --threads.
// The defaults are those of `options`, which must outlive parsing. --method litags-paper means
// PaperSettings, changed by the options beside it.
void AddMethodOptions(CLI::App* app, ReconstructOptions* options);

}  // namespace litags

#endif  // LITAGS_ENGINE_TOOLS_EVALUATION_METHOD_OPTIONS_H_
