#include <filesystem>
#include <iostream>
#include <memory>
#include <string>
#include <system_error>

#include "CLI/App.hpp"
#include "CLI/Config.hpp"
#include "CLI/Formatter.hpp"
#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "engine/tools/bench/command_options.h"
#include "engine/tools/bench/commands.h"
#include "engine/tools/bench/reference.h"

namespace litags {

void AddReferenceCommand(CLI::App* app, int* exit_status) {
  CLI::App* command = app->add_subcommand(
      "reference", "Compare the engine with reference cases (folders of case.json and .npy).");
  auto folder = std::make_shared<std::string>();
  command->add_option("DIR", *folder, "a folder of case folders, or one case folder")->required();
  WhenGiven(command, exit_status, [folder, exit_status]() -> absl::Status {
    if (std::error_code ignored; !std::filesystem::is_directory(*folder, ignored)) {
      return InvalidInput("NO_SUCH_FOLDER", "DIR",
                          absl::StrCat(*folder, ": there is no such folder; give one of cases"));
    }
    *exit_status = RunReferenceCases(*folder, std::cout).AllPassed() ? 0 : 1;
    return absl::OkStatus();
  });
}

}  // namespace litags
