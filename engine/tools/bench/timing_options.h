// Options of commands that time iterations on a made-up scene.
#ifndef LITAGS_ENGINE_TOOLS_BENCH_TIMING_OPTIONS_H_
#define LITAGS_ENGINE_TOOLS_BENCH_TIMING_OPTIONS_H_

#include <cstdio>
#include <string>

#include "CLI/App.hpp"
#include "CLI/Error.hpp"
#include "engine/tools/bench/command_options.h"
#include "proto/arguments/arguments.h"

namespace litags {

struct TimingOptions {
  int gaussians = 100000, width = 500, height = 375, repetitions = 15;
};

// Adds --size WxH; `width` and `height` must outlive the command.
inline void AddSizeOption(CLI::App* command, int* width, int* height) {
  const std::string standard = std::to_string(*width) + "x" + std::to_string(*height);
  const auto set_size = [width, height](const std::string& text) {
    int used = 0;
    if (std::sscanf(text.c_str(), "%5dx%5d%n", width, height, &used) != 2 ||
        used != static_cast<int>(text.size()) || *width < 1 || *height < 1 || *width > 16384 ||
        *height > 16384) {
      throw CLI::ValidationError("--size " + text + ": give WIDTHxHEIGHT in 1..16384");
    }
  };
  command->add_option_function<std::string>("--size", set_size, "WxH, px")->default_str(standard);
}

// Adds --gaussians, --size and --repetitions. `options` must outlive the command.
inline void AddTimingOptions(CLI::App* command, TimingOptions* options) {
  AddGaussiansOption(command, &options->gaussians);
  AddSizeOption(command, &options->width, &options->height);
  command->add_option("--repetitions", options->repetitions)
      ->capture_default_str()
      ->check(Between(1, 1000));
}

}  // namespace litags

#endif  // LITAGS_ENGINE_TOOLS_BENCH_TIMING_OPTIONS_H_
