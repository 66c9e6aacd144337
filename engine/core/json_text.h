// JSON to text and back. Compiled once: the library's writer and parser take seconds in every file
// that calls them.
#ifndef LITAGS_ENGINE_CORE_JSON_TEXT_H_
#define LITAGS_ENGINE_CORE_JSON_TEXT_H_

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <string_view>

namespace litags {

// `indent` spaces a level; -1: one line. Bytes that are no UTF-8, as names of files may hold,
// become U+FFFD; dump() would throw.
std::string JsonText(const nlohmann::json& json, int indent = -1);
std::string JsonText(const nlohmann::ordered_json& json, int indent = -1);

// is_discarded() if `text` is no JSON.
nlohmann::json ParseJson(std::string_view text);

}  // namespace litags

#endif  // LITAGS_ENGINE_CORE_JSON_TEXT_H_
