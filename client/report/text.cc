#include "client/report/text.h"

#include <openssl/asn1.h>

#include <algorithm>
#include <cmath>
#include <ctime>
#include <iterator>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"

namespace litags::report {
namespace {

// Of a value that may be none of its enum's: a newer server's.
std::string WordOf(const google::protobuf::EnumDescriptor& type, int number) {
  const auto* value = type.FindValueByNumber(number);
  return value != nullptr ? EnumWord(*value) : absl::StrCat(number);
}

struct Character {
  size_t length = 0;  // in bytes; 0: the first byte belongs to no character
  unsigned long code = 0;
};

Character FirstCharacter(std::string_view text) {
  Character first;
  const int length = UTF8_getc(reinterpret_cast<const unsigned char*>(text.data()),
                               static_cast<int>(std::min<size_t>(text.size(), 4)), &first.code);
  const bool surrogate = first.code >= 0xD800 && first.code < 0xE000;
  if (length > 0 && first.code <= 0x10FFFF && !surrogate)
    first.length = static_cast<size_t>(length);
  return first;
}

// Shows nothing, and changes how what is beside it shows: controls, line separators, and what
// steers the direction of text.
bool IsControl(unsigned long code) {
  return code < 0x20 || (code >= 0x7F && code < 0xA0) || code == 0x061C || code == 0x200E ||
         code == 0x200F || (code >= 0x2028 && code <= 0x202E) || (code >= 0x2066 && code <= 0x2069);
}

}  // namespace

double SecondsOf(const google::protobuf::Duration& duration) {
  return static_cast<double>(duration.seconds()) + 1e-9 * duration.nanos();
}

std::string DurationText(double seconds) {
  const auto total = static_cast<int64_t>(std::llround(std::clamp(seconds, 0.0, 1e9)));
  if (total < 60) return absl::StrFormat("%ds", total);
  if (total < 3600) return absl::StrFormat("%dm%02ds", total / 60, total % 60);
  return absl::StrFormat("%dh%02dm", total / 3600, total / 60 % 60);
}

std::string CountText(int64_t count) {
  const std::string digits = absl::StrCat(count);
  const size_t sign = count < 0 ? 1 : 0;
  std::string text;
  for (size_t i = 0; i < digits.size(); ++i) {
    if (i > sign && (digits.size() - i) % 3 == 0) text.push_back(',');
    text.push_back(digits[i]);
  }
  return text;
}

std::string BytesText(int64_t bytes) {
  if (bytes < 1024) return absl::StrCat(bytes, " B");
  double value = static_cast<double>(bytes);
  const char* const units[] = {"KiB", "MiB", "GiB", "TiB"};
  size_t unit = 0;
  for (value /= 1024; value >= 1023.95 && unit + 1 < std::size(units); value /= 1024) ++unit;
  // "16 GiB" as the settings have it, not "16.0 GiB".
  return value == std::floor(value) ? absl::StrFormat("%.0f %s", value, units[unit])
                                    : absl::StrFormat("%.1f %s", value, units[unit]);
}

// The first value is FOO_UNSPECIFIED.
std::string EnumWord(const google::protobuf::EnumValueDescriptor& value) {
  const std::string& first = value.type()->value(0)->name();
  const size_t prefix = first.size() - std::string_view("UNSPECIFIED").size();
  std::string word = absl::AsciiStrToLower(value.name().substr(prefix));
  std::replace(word.begin(), word.end(), '_', '-');
  return word;
}

std::string StateText(v1::JobState state) { return WordOf(*v1::JobState_descriptor(), state); }

std::string StageText(v1::Stage stage) { return WordOf(*v1::Stage_descriptor(), stage); }

std::string TimeText(const google::protobuf::Timestamp& time) {
  if (time.seconds() == 0) return "";
  const std::time_t seconds = time.seconds();
  std::tm parts{};
  gmtime_r(&seconds, &parts);
  char text[32];
  std::strftime(text, sizeof(text), "%Y-%m-%d %H:%M:%S", &parts);
  return text;
}

bool IsUtf8(std::string_view text) {
  while (!text.empty()) {
    const size_t length = FirstCharacter(text).length;
    if (length == 0) return false;
    text.remove_prefix(length);
  }
  return true;
}

std::string Printable(std::string_view text) {
  std::string result;
  while (!text.empty()) {
    const auto [length, code] = FirstCharacter(text);
    if (length == 0 || (IsControl(code) && code != '\n')) {
      result.push_back('?');
    } else {
      result.append(text.substr(0, length));
    }
    text.remove_prefix(std::max<size_t>(1, length));
  }
  return result;
}

}  // namespace litags::report
