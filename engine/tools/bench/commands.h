// Subcommands of litags-bench, one source file each.
#ifndef LITAGS_ENGINE_TOOLS_BENCH_COMMANDS_H_
#define LITAGS_ENGINE_TOOLS_BENCH_COMMANDS_H_

#include "CLI/App.hpp"

namespace litags {

// Each adds one command, which sets *exit_status when it has run.
void AddReferenceCommand(CLI::App* app, int* exit_status);
void AddKernelsCommand(CLI::App* app, int* exit_status);
void AddMachineCommand(CLI::App* app, int* exit_status);
void AddRenderCommand(CLI::App* app, int* exit_status);
void AddTrainCommand(CLI::App* app, int* exit_status);
void AddThreadsCommand(CLI::App* app);  // never fails
void AddScoreCommand(CLI::App* app, int* exit_status);
void AddDepthCommand(CLI::App* app, int* exit_status);
void AddTableCommand(CLI::App* app, int* exit_status);
void AddNoiseCommand(CLI::App* app, int* exit_status);
void AddExportCommand(CLI::App* app, int* exit_status);
void AddGeometryCommand(CLI::App* app, int* exit_status);
void AddExposureCommand(CLI::App* app, int* exit_status);
void AddShadowsCommand(CLI::App* app, int* exit_status);

}  // namespace litags

#endif  // LITAGS_ENGINE_TOOLS_BENCH_COMMANDS_H_
