// What commands of litags-bench share.
#ifndef LITAGS_ENGINE_TOOLS_BENCH_COMMAND_OPTIONS_H_
#define LITAGS_ENGINE_TOOLS_BENCH_COMMAND_OPTIONS_H_

#include <functional>
#include <string>

#include "CLI/App.hpp"
#include "absl/status/status.h"
#include "engine/tools/evaluation/benchmark_scene.h"

namespace litags {

// Runs `body` when the command is given. Its error goes to stderr and sets the exit status.
void WhenGiven(CLI::App* command, int* exit_status, std::function<absl::Status()> body);

// Variables of options must outlive the command.

// Adds SCENE, which is returned, and --light, which is "low" by default.
CLI::Option* AddSceneOptions(CLI::App* command, const std::string& help, BenchmarkScene* scene);

// Adds -o, the folder that is written into; it is required.
void AddOutputOption(CLI::App* command, const std::string& help, std::string* path);

// Adds --gaussians, of a made-up scene.
void AddGaussiansOption(CLI::App* command, int* gaussians);

// Adds --threads.
void AddThreadsOption(CLI::App* command, int* threads);

// Adds --lpips, the path of a network.
void AddLpipsOption(CLI::App* command, std::string* path);

// Takes maps and network, which are given by options that litags-bench has not, out of
// --depth-source.
void RefuseGivenDepth(CLI::App* command);

// Adds --json; WriteJson writes there if it was given.
void AddJsonOption(CLI::App* command, std::string* path);
absl::Status WriteJson(const std::string& path, const std::string& json);

}  // namespace litags

#endif  // LITAGS_ENGINE_TOOLS_BENCH_COMMAND_OPTIONS_H_
