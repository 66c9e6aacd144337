// Text from strangers.
#ifndef LITAGS_ENGINE_CORE_UTF8_H_
#define LITAGS_ENGINE_CORE_UTF8_H_

#include <cstddef>
#include <string>
#include <string_view>

namespace litags {

// Length of the valid UTF-8 sequence at the start of `s` (no overlong forms, no surrogates), 0 if
// there is none.
size_t Utf8Length(std::string_view s);
bool IsUtf8(std::string_view text);

// Length of the character at the start of `s` if it is one that shows nothing and changes what is
// shown beside it, else 0: control characters, line and paragraph separators, and those that turn
// the order of text around. Marks of direction, which names in Arabic or Hebrew hold, are none.
size_t ControlLength(std::string_view s);
bool HoldsControl(std::string_view text);

// Without the byte order mark that Windows' editors write first.
std::string_view WithoutByteOrderMark(std::string_view text);

// The start of `text`, of at most `max_bytes`, as valid UTF-8: whole characters only, and U+FFFD
// for each byte that belongs to none.
std::string Utf8Prefix(std::string_view text, size_t max_bytes);

}  // namespace litags

#endif  // LITAGS_ENGINE_CORE_UTF8_H_
