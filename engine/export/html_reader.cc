#include "absl/strings/escaping.h"
#include "engine/export/readers.h"

namespace litags {

absl::StatusOr<ViewerScene> DecodeHtml(std::string_view bytes) {
  constexpr std::string_view kStart = "id=\"scene\">", kEnd = "</script>";
  const size_t start = bytes.find(kStart);
  const size_t end = start == bytes.npos ? start : bytes.find(kEnd, start);
  std::string scene;
  if (end == bytes.npos ||
      !absl::Base64Unescape(
          std::string(bytes.substr(start + kStart.size(), end - start - kStart.size())), &scene)) {
    return Corrupt("the page holds no scene");
  }
  return DecodeCompressedPly(scene);
}

}  // namespace litags
