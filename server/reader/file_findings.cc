#include "server/reader/file_findings.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "absl/strings/ascii.h"
#include "absl/strings/escaping.h"
#include "absl/strings/numbers.h"
#include "absl/strings/str_cat.h"
#include "absl/strings/str_format.h"
#include "absl/strings/str_split.h"
#include "engine/core/photo_names.h"
#include "engine/core/utf8.h"
#include "engine/io/file_util.h"
#include "engine/pipeline/fingerprint.h"

namespace litags {
namespace {

// The first word of the line. Another order or meaning of the others gets another.
constexpr char kPhotoVersion[] = "4", kVideoVersion[] = "video1", kCamerasVersion[] = "cameras1";
constexpr char kOneColor[] = "-";  // instead of a fingerprint
constexpr size_t kMaxFingerprint = 16;
constexpr double kMaxNumber = 1e9;
constexpr size_t kMaxCameraPath = 255;    // bytes
constexpr size_t kMaxCameraKeys = 10000;  // with the path in one packet (channel.h), as base64
constexpr size_t kKeyBytes = sizeof(uint32_t);

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

uint32_t HashOf(std::string_view text) {
  Fingerprint fingerprint;
  fingerprint.Add(text.data(), text.size());
  return static_cast<uint32_t>(fingerprint.hash());
}

}  // namespace

CameraFindings CameraFindings::Of(absl::Span<const std::string> paths) {
  CameraFindings findings;
  findings.path = Utf8Prefix(paths.front(), kMaxCameraPath);
  std::vector<uint32_t>& keys = findings.keys;
  for (const std::string& path : paths) {
    for (const std::string& key : KeysOf(path)) keys.push_back(HashOf(key));
  }
  std::sort(keys.begin(), keys.end());
  keys.erase(std::unique(keys.begin(), keys.end()), keys.end());
  return findings;
}

bool CameraFindings::MayHave(std::string_view photo) const {
  return std::binary_search(keys.begin(), keys.end(), HashOf(StemKey(photo)));
}

int CameraFindings::HowNamed(const std::string& photo) const {
  return litags::HowNamed(photo, [&](const std::string& key) {
    return std::binary_search(keys.begin(), keys.end(), HashOf(key));
  });
}

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

std::string Encode(const CameraFindings& findings) {
  if (findings.keys.size() > kMaxCameraKeys) return "";
  std::string bytes;
  for (const uint32_t key : findings.keys) {
    for (size_t i = 0; i < kKeyBytes; ++i) bytes.push_back(static_cast<char>(key >> (8 * i)));
  }
  return absl::StrCat(kCamerasVersion, " ", absl::Base64Escape(findings.path), " ",
                      absl::Base64Escape(bytes));
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

std::optional<CameraFindings> ParseCameraFindings(std::string_view about) {
  const std::vector<std::string> words = Words(about);
  CameraFindings findings;
  std::string bytes;
  if (words.size() != 3 || words.front() != kCamerasVersion ||
      !absl::Base64Unescape(words[1], &findings.path) || !absl::Base64Unescape(words[2], &bytes) ||
      findings.path.size() > kMaxCameraPath || !IsUtf8(findings.path) ||
      bytes.size() % kKeyBytes != 0 || bytes.size() > kMaxCameraKeys * kKeyBytes) {
    return std::nullopt;
  }
  for (size_t at = 0; at < bytes.size(); at += kKeyBytes) {
    uint32_t key = 0;
    for (size_t i = 0; i < kKeyBytes; ++i) {
      key |= uint32_t{static_cast<unsigned char>(bytes[at + i])} << (8 * i);
    }
    findings.keys.push_back(key);
  }
  const bool sorted = std::is_sorted(findings.keys.begin(), findings.keys.end());
  return sorted ? std::optional(std::move(findings)) : std::nullopt;
}

}  // namespace litags
