#include "server/reader/photo_findings.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_split.h"

namespace litags {
namespace {

// The first word of the line. Another order or meaning of the others gets another.
constexpr char kVersion[] = "1";
constexpr char kOneColor[] = "-";  // instead of a fingerprint
constexpr size_t kMaxFingerprint = 16;
constexpr double kMaxNumber = 1e9;

// In the order of the line.
template <typename Findings>
auto Numbers(Findings& f) {
  return std::array{&f.focal_length, &f.exposure_time, &f.iso,      &f.f_number,
                    &f.mean_code,    &f.light,         &f.structure};
}

}  // namespace

std::string Encode(const PhotoFindings& findings) {
  std::string line = kVersion;
  for (const double* number : Numbers(findings)) absl::StrAppendFormat(&line, " %.6g", *number);
  absl::StrAppendFormat(&line, " %s", findings.pixels.empty() ? kOneColor : findings.pixels);
  return line;
}

std::optional<PhotoFindings> ParseFindings(std::string_view about) {
  const std::vector<std::string> words =
      absl::StrSplit(absl::string_view(about.data(), about.size()), ' ');
  PhotoFindings findings;
  const auto numbers = Numbers(findings);
  if (words.size() != numbers.size() + 2 || words.front() != kVersion) return std::nullopt;
  for (size_t i = 0; i < numbers.size(); ++i) {
    if (!absl::SimpleAtod(words[i + 1], numbers[i]) || !(std::abs(*numbers[i]) <= kMaxNumber)) {
      return std::nullopt;
    }
  }
  if (words.back() == kOneColor) return findings;
  findings.pixels = words.back();
  const bool is_fingerprint =
      findings.pixels.size() == kMaxFingerprint &&
      std::all_of(findings.pixels.begin(), findings.pixels.end(), absl::ascii_isxdigit);
  return is_fingerprint ? std::optional(findings) : std::nullopt;
}

}  // namespace litags
