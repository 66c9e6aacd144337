// litags-bench: measurements of the engine, and its agreement with reference numbers.
#include "CLI/App.hpp"
#include "CLI/Config.hpp"
#include "CLI/Formatter.hpp"
#include "engine/tools/bench/commands.h"
#include "engine/tools/bench/machine.h"
#include "proto/arguments/arguments.h"

namespace {

int Run(int argc, char** argv) {
  CLI::App app("Measures the litags engine.", "litags-bench");
  app.set_version_flag("--version", LITAGS_VERSION);
  app.require_subcommand(1);
  app.add_option_function<std::string>(
      "--instruction-set",
      [](const std::string& name) {
        const absl::Status limited = litags::LimitInstructionSet(name);
        if (!limited.ok()) throw CLI::ValidationError(std::string(limited.message()));
      },
      "kernels use no wider one than this, e.g. AVX2");
  int exit_status = 0;
  litags::AddReferenceCommand(&app, &exit_status);
  litags::AddKernelsCommand(&app, &exit_status);
  litags::AddMachineCommand(&app, &exit_status);
  litags::AddRenderCommand(&app, &exit_status);
  litags::AddTrainCommand(&app, &exit_status);
  litags::AddThreadsCommand(&app);
  litags::AddScoreCommand(&app, &exit_status);
  litags::AddDepthCommand(&app, &exit_status);
  litags::AddTableCommand(&app, &exit_status);
  litags::AddNoiseCommand(&app, &exit_status);
  litags::AddExportCommand(&app, &exit_status);
  litags::AddGeometryCommand(&app, &exit_status);
  litags::AddExposureCommand(&app, &exit_status);
  litags::AddShadowsCommand(&app, &exit_status);
  if (const auto exit = litags::ParseArguments(app, argc, argv)) return *exit;
  return litags::FlushOutput(exit_status);
}

}  // namespace

int main(int argc, char** argv) {
  return litags::RunProgram("litags-bench", [&] { return Run(argc, argv); });
}
