#include <cstdint>

#include "absl/strings/str_cat.h"
#include "engine/tools/contact_sheet/contact_sheet.h"

namespace litags {
namespace {

// The next code point, and its bytes taken off; a byte that is no UTF-8 alone.
uint32_t Next(absl::string_view* text) {
  const auto byte = [&](size_t i) { return static_cast<uint8_t>((*text)[i]); };
  const uint8_t first = byte(0);
  const size_t size = first < 0xc0 ? 1 : first < 0xe0 ? 2 : first < 0xf0 ? 3 : 4;
  uint32_t code = size == 1 ? first : first & (0xff >> (size + 1));
  size_t used = 1;
  for (; used < size && used < text->size() && (byte(used) & 0xc0) == 0x80; ++used) {
    code = code << 6 | (byte(used) & 0x3f);
  }
  text->remove_prefix(used);
  return code;
}

// U+00C0 to U+017F without accents.
constexpr char kLetters[] =
    "AAAAAAACEEEEIIIIDNOOOOOxOUUUUYTsaaaaaaaceeeeiiiidnooooo/ouuuuyty"
    "AaAaAaCcCcCcCcDdDdEeEeEeEeEeGgGgGgGgHhHhIiIiIiIiIiJjJjKkkLlLlLlLlLlNnNnNnnNn"
    "OoOoOoOoRrRrRrSsSsSsSsTtTtTtUuUuUuUuUuUuWwYyYZzZzZzs";
static_assert(sizeof(kLetters) - 1 == 0x180 - 0xc0);

absl::string_view Plain(uint32_t code) {
  if (code == 0xdf) return "ss";
  if (code >= 0xc0 && code < 0x180) return absl::string_view(kLetters).substr(code - 0xc0, 1);
  if (code >= 0x300 && code < 0x370) return "";  // an accent of the letter before
  if (code >= 0x2010 && code <= 0x2015) return "-";
  if (code >= 0x2018 && code <= 0x201b) return "'";
  if (code >= 0x201c && code <= 0x201f) return "\"";
  if (code == 0x2026) return "...";
  if (code == 0xa0 || code == 0x202f) return " ";
  return "_";
}

}  // namespace

std::string PlainText(absl::string_view text) {
  std::string plain;
  while (!text.empty()) {
    const uint32_t code = Next(&text);
    if ((code >= 0x20 && code < 0x7f) || code == '\n') {
      plain += static_cast<char>(code);
    } else {
      absl::StrAppend(&plain, Plain(code));
    }
  }
  return plain;
}

}  // namespace litags
