// How every program reads its arguments.
#ifndef LITAGS_ENGINE_CORE_ARGUMENTS_H_
#define LITAGS_ENGINE_CORE_ARGUMENTS_H_

#include <optional>

#include "CLI/App.hpp"
#include "CLI/Config.hpp"
#include "CLI/Formatter.hpp"

namespace litags {

// Reads them; the exit status where the program is to end: 0 after --help, 2 for bad usage.
inline std::optional<int> ParseArguments(CLI::App& app, int argc, char** argv) {
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }
  return std::nullopt;
}

}  // namespace litags

#endif  // LITAGS_ENGINE_CORE_ARGUMENTS_H_
