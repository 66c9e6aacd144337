#include "client/labels.h"

#include "absl/strings/str_cat.h"
#include "client/cli.h"

namespace litags::client {

void AddLabelOption(CLI::App& command, std::vector<std::string>& labels) {
  // One a flag: "--label site=north DIR" names the folder, too.
  command.add_option("--label", labels, "Your own word about the job, as site=north; repeatable")
      ->allow_extra_args(false);
}

bool ParseLabels(const std::vector<std::string>& texts,
                 google::protobuf::Map<std::string, std::string>* labels) {
  for (const std::string& text : texts) {
    const size_t equals = text.find('=');
    if (equals == std::string::npos || equals == 0) {
      Note(absl::StrCat("--label ", text, ": a label is KEY=VALUE, such as site=north"));
      return false;
    }
    (*labels)[text.substr(0, equals)] = text.substr(equals + 1);
  }
  return true;
}

}  // namespace litags::client
