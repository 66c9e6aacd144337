// Subcommands of litags-bench, one source file each.
#ifndef LITAGS_ENGINE_TOOLS_BENCH_COMMANDS_H_
#define LITAGS_ENGINE_TOOLS_BENCH_COMMANDS_H_

#include "CLI/App.hpp"

namespace litags {

// `litags-bench reference DIR`. Sets *exit_status when it has run.
void AddReferenceCommand(CLI::App* app, int* exit_status);

// `litags-bench kernels`, `machine`, `render`, `train`, `score`, `table`.
void AddKernelsCommand(CLI::App* app, int* exit_status);
void AddMachineCommand(CLI::App* app, int* exit_status);
void AddRenderCommand(CLI::App* app, int* exit_status);
void AddTrainCommand(CLI::App* app, int* exit_status);
// `litags-bench threads`.
void AddThreadsCommand(CLI::App* app);
void AddScoreCommand(CLI::App* app, int* exit_status);

// `litags-bench depth SCENE`.
void AddDepthCommand(CLI::App* app, int* exit_status);
void AddTableCommand(CLI::App* app, int* exit_status);

// `litags-bench noise SCENE PICTURES`.
void AddNoiseCommand(CLI::App* app, int* exit_status);

// `litags-bench export SCENE`.
void AddExportCommand(CLI::App* app, int* exit_status);

// `litags-bench geometry SCENE TRUTH`.
void AddGeometryCommand(CLI::App* app, int* exit_status);

// `litags-bench exposure PHOTOS`.
void AddExposureCommand(CLI::App* app, int* exit_status);

// `litags-bench shadows PHOTOS`.
void AddShadowsCommand(CLI::App* app, int* exit_status);

}  // namespace litags

#endif  // LITAGS_ENGINE_TOOLS_BENCH_COMMANDS_H_
