#include "server/jobs/labels.h"

#include <algorithm>

#include "absl/strings/ascii.h"
#include "absl/strings/escaping.h"
#include "absl/strings/str_cat.h"
#include "engine/core/error.h"

namespace litags {
namespace {

constexpr size_t kMaxLabels = 64, kMaxLength = 63;

bool IsKey(const std::string& key) {
  return !key.empty() && key.size() <= kMaxLength && absl::ascii_islower(key[0]) &&
         std::all_of(key.begin(), key.end(), [](char c) {
           return absl::ascii_islower(c) || absl::ascii_isdigit(c) || c == '_' || c == '-';
         });
}

bool IsValue(const std::string& value) {
  return value.size() <= kMaxLength && std::all_of(value.begin(), value.end(), [](char c) {
           return absl::ascii_isalnum(c) || c == '_' || c == '-' || c == '.';
         });
}

}  // namespace

absl::Status CheckLabels(const Labels& labels) {
  if (labels.size() > kMaxLabels) {
    return InvalidInput("LABELS_INVALID", "labels",
                        absl::StrCat("labels: ", labels.size(), " are too many; at most ",
                                     kMaxLabels, " are allowed"));
  }
  for (const auto& [key, value] : labels) {
    if (!IsKey(key)) {
      return InvalidInput("LABELS_INVALID", "labels",
                          absl::StrCat("labels: the key \"", absl::CHexEscape(key),
                                       "\" should have 1 to ", kMaxLength,
                                       " lower-case letters, digits, \"_\" and \"-\", and begin "
                                       "with a letter"));
    }
    if (!IsValue(value)) {
      return InvalidInput("LABELS_INVALID", absl::StrCat("labels.", key),
                          absl::StrCat("labels.", key, ": a value has at most ", kMaxLength,
                                       " letters, digits, \"_\", \".\" and \"-\""));
    }
  }
  return absl::OkStatus();
}

}  // namespace litags
