#include "client/report/text.h"

#include <openssl/asn1.h>

#include <algorithm>
#include <cmath>
#include <ctime>
#include <iterator>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_join.h"

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

struct CodeRange {
  unsigned long first, last;
};

template <size_t N>
bool IsIn(const CodeRange (&ranges)[N], unsigned long code) {
  return std::any_of(std::begin(ranges), std::end(ranges), [code](const CodeRange& range) {
    return code >= range.first && code <= range.last;
  });
}

// Of scripts and signs in use, as Unicode's EastAsianWidth.txt and its class Mn have them.
constexpr CodeRange kWide[] = {
    {0x1100, 0x115F},   {0x2E80, 0x303E},   {0x3041, 0xA4CF},   {0xA960, 0xA97C},
    {0xAC00, 0xD7A3},   {0xF900, 0xFAFF},   {0xFE30, 0xFE6F},   {0xFF00, 0xFF60},
    {0xFFE0, 0xFFE6},   {0x1F300, 0x1F64F}, {0x1F680, 0x1F6FF}, {0x1F900, 0x1F9FF},
    {0x20000, 0x3FFFD},
};
constexpr CodeRange kOverlaid[] = {
    {0x0300, 0x036F}, {0x200B, 0x200D}, {0x20D0, 0x20FF}, {0x3099, 0x309A}, {0xFE00, 0xFE0F}};

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

std::string Counted(int64_t count, const char* noun) {
  return absl::StrCat(count, " ", noun, count == 1 ? "" : "s");
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

bool IsOfVideo(const v1::Job& job) {
  return job.photos() == 0 && job.bytes() > 0 && job.state() != v1::JOB_STATE_UPLOADING;
}

std::string LabelsText(const v1::Job& job) {
  std::vector<std::string> texts;
  for (const auto& [key, value] : job.labels()) texts.push_back(absl::StrCat(key, "=", value));
  std::sort(texts.begin(), texts.end());
  return absl::StrJoin(texts, " ");
}

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

std::string PrintableLine(std::string_view text) {
  std::string line = Printable(text);
  std::replace(line.begin(), line.end(), '\n', '?');
  return line;
}

size_t ColumnsOf(std::string_view text) {
  size_t columns = 0;
  while (!text.empty()) {
    const auto [length, code] = FirstCharacter(text);
    if (!IsIn(kOverlaid, code)) columns += IsIn(kWide, code) ? 2 : 1;
    text.remove_prefix(std::max<size_t>(1, length));
  }
  return columns;
}

std::string Padded(std::string_view text, size_t columns) {
  const size_t used = ColumnsOf(text);
  return std::string(text) + std::string(columns > used ? columns - used : 0, ' ');
}

}  // namespace litags::report
