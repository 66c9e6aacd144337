#include "server/reader/file_findings.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "absl/strings/ascii.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_split.h"
#include "absl/types/span.h"

namespace litags {
namespace {

// The first word of the line. Another order or meaning of the others gets another.
constexpr char kPhotoVersion[] = "4", kVideoVersion[] = "video1";
constexpr char kOneColor[] = "-";  // instead of a fingerprint
constexpr size_t kMaxFingerprint = 16;
constexpr double kMaxNumber = 1e9;

// In the order of the line.
template <typename Findings>
auto NumbersOfPhoto(Findings& f) {
  return std::array{&f.focal_length, &f.exposure_time, &f.iso,       &f.f_number,
                    &f.mean_code,    &f.light,         &f.structure, &f.sharpness,
                    &f.fine_detail,  &f.coarse_detail, &f.has_views};
}

std::vector<std::string> Words(std::string_view about) {
  return absl::StrSplit(absl::string_view(about.data(), about.size()), ' ');
}

// The words behind the first are these numbers.
bool ReadNumbers(const std::vector<std::string>& words, const char* version,
                 absl::Span<double* const> numbers) {
  if (words.size() <= numbers.size() || words.front() != version) return false;
  for (size_t i = 0; i < numbers.size(); ++i) {
    if (!absl::SimpleAtod(words[i + 1], numbers[i]) || !(std::abs(*numbers[i]) <= kMaxNumber)) {
      return false;
    }
  }
  return true;
}

}  // namespace

std::string Encode(const PhotoFindings& findings) {
  std::string line = kPhotoVersion;
  for (const double* number : NumbersOfPhoto(findings)) {
    absl::StrAppendFormat(&line, " %.6g", *number);
  }
  absl::StrAppendFormat(&line, " %s", findings.pixels.empty() ? kOneColor : findings.pixels);
  return line;
}

std::string Encode(const VideoFindings& findings) {
  return absl::StrFormat("%s %.6g %.9g", kVideoVersion, findings.seconds, findings.frames);
}

std::optional<PhotoFindings> ParsePhotoFindings(std::string_view about) {
  const std::vector<std::string> words = Words(about);
  PhotoFindings findings;
  const auto numbers = NumbersOfPhoto(findings);
  if (!ReadNumbers(words, kPhotoVersion, numbers) || words.size() != numbers.size() + 2) {
    return std::nullopt;
  }
  if (words.back() == kOneColor) return findings;
  findings.pixels = words.back();
  const bool is_fingerprint =
      findings.pixels.size() == kMaxFingerprint &&
      std::all_of(findings.pixels.begin(), findings.pixels.end(), absl::ascii_isxdigit);
  return is_fingerprint ? std::optional(findings) : std::nullopt;
}

std::optional<VideoFindings> ParseVideoFindings(std::string_view about) {
  const std::vector<std::string> words = Words(about);
  VideoFindings findings;
  const bool read = words.size() == 3 &&
                    ReadNumbers(words, kVideoVersion, {&findings.seconds, &findings.frames}) &&
                    findings.seconds >= 0 && findings.frames >= 0;
  return read ? std::optional(findings) : std::nullopt;
}

}  // namespace litags
