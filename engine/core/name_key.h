// Names of files as programs and disks write them: what looks alike is alike.
#ifndef LITAGS_ENGINE_CORE_NAME_KEY_H_
#define LITAGS_ENGINE_CORE_NAME_KEY_H_

#include <string>
#include <string_view>

namespace litags {

// Equal for names that differ in case (of ASCII letters) or in how letters with marks are written:
// as one character, or as a letter and its mark, as macOS stores them. Latin, Greek, Cyrillic, kana
// and Hangul.
std::string NameKey(std::string_view name);

// "a%20b" as "a b": some exporters write paths as URLs. What is no code stays.
std::string WithoutPercent(std::string_view text);

}  // namespace litags

#endif  // LITAGS_ENGINE_CORE_NAME_KEY_H_
