// Inside this module: JSON of strangers as a tree of bounded size.
#ifndef LITAGS_ENGINE_IO_BOUNDED_JSON_H_
#define LITAGS_ENGINE_IO_BOUNDED_JSON_H_

#include <nlohmann/json.hpp>
#include <span>
#include <string_view>

#include "absl/status/statusor.h"

namespace litags {

// Without the members called `dropped`, at whatever depth, whose values are not counted.
// INVALID_ARGUMENT: BAD_JSON.
absl::StatusOr<nlohmann::json> ParseBoundedJson(std::string_view text, std::string_view field,
                                                std::span<const std::string_view> dropped);

// A number, or a text of one.
bool ReadNumber(const nlohmann::json& value, double* out);
// An array of exactly as many of those.
bool ReadNumbers(const nlohmann::json& value, std::span<double> out);
// A text, or a whole number as one: how files name what belongs together.
std::string TextOf(const nlohmann::json& value);
// The member, or null.
const nlohmann::json& Member(const nlohmann::json& object, const char* key);

}  // namespace litags

#endif  // LITAGS_ENGINE_IO_BOUNDED_JSON_H_
