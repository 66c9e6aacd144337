#include <iostream>
#include <memory>
#include <string>

#include "CLI/App.hpp"
#include "CLI/Config.hpp"
#include "CLI/Formatter.hpp"
#include "engine/tools/bench/commands.h"
#include "engine/tools/bench/reference.h"

namespace litags {

void AddReferenceCommand(CLI::App* app, int* exit_status) {
  CLI::App* command = app->add_subcommand(
      "reference", "Compare the engine with reference cases (folders of case.json and .npy).");
  auto folder = std::make_shared<std::string>();
  command->add_option("DIR", *folder, "a folder of case folders, or one case folder")->required();
  command->callback([folder, exit_status] {
    *exit_status = RunReferenceCases(*folder, std::cout).AllPassed() ? 0 : 1;
  });
}

}  // namespace litags
