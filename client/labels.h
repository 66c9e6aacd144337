#ifndef LITAGS_CLIENT_LABELS_H_
#define LITAGS_CLIENT_LABELS_H_

#include <google/protobuf/map.h>

#include <string>
#include <vector>

#include "CLI/CLI.hpp"

namespace litags::client {

// Adds --label KEY=VALUE, which may be given several times.
void AddLabelOption(CLI::App& command, std::vector<std::string>& labels);

// False, having said so on stderr, for a text without a key or "=".
bool ParseLabels(const std::vector<std::string>& texts,
                 google::protobuf::Map<std::string, std::string>* labels);

}  // namespace litags::client

#endif  // LITAGS_CLIENT_LABELS_H_
