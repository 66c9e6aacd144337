// --size of commands that time a made-up scene.
#ifndef LITAGS_ENGINE_TOOLS_BENCH_SIZE_OPTION_H_
#define LITAGS_ENGINE_TOOLS_BENCH_SIZE_OPTION_H_

#include <cstdio>
#include <string>

#include "CLI/App.hpp"
#include "CLI/Error.hpp"

namespace litags {

struct PictureSize {
  int width = 500, height = 375;
};

// Adds --size WxH, px, each in 1..16384. `size` must outlive the command.
inline void AddSizeOption(CLI::App* command, PictureSize* size) {
  const auto parse = [size](const std::string& text) {
    if (std::sscanf(text.c_str(), "%dx%d", &size->width, &size->height) != 2 || size->width < 1 ||
        size->height < 1 || size->width > 16384 || size->height > 16384) {
      throw CLI::ValidationError("--size " + text + ": give WIDTHxHEIGHT in 1..16384");
    }
  };
  command->add_option_function<std::string>("--size", parse, "WxH, px (500x375)");
}

}  // namespace litags

#endif  // LITAGS_ENGINE_TOOLS_BENCH_SIZE_OPTION_H_
