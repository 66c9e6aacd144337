#include "client/sibling.h"

#include <unistd.h>

#include <filesystem>
#include <system_error>

#include "absl/strings/str_cat.h"

namespace litags::client {

std::string SiblingProgram(const std::string& name) {
  std::error_code ignored;
  const auto beside = std::filesystem::read_symlink("/proc/self/exe", ignored).parent_path() / name;
  return access(beside.c_str(), X_OK) == 0 ? beside.string() : name;
}

std::string SiblingMissing(const std::string& name, int error) {
  return absl::StrCat(name, " cannot be started (", std::generic_category().message(error),
                      "); it is installed with litags, and looked for beside it and in PATH");
}

}  // namespace litags::client
