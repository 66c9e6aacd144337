#include "engine/sfm/colmap_version.h"

#include <algorithm>
#include <string_view>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "engine/core/subprocess.h"

namespace litags {
namespace {

constexpr double kMaxSeconds = 20;
constexpr std::string_view kName = "COLMAP ";

// "3.13.0" of a line with "COLMAP 3.13.0"; empty: it names none.
std::string_view VersionIn(std::string_view line) {
  const size_t name = line.find(kName);
  if (name == std::string_view::npos) return "";
  line.remove_prefix(name + kName.size());
  line = line.substr(0, line.find_first_not_of("0123456789."));
  return line;
}

}  // namespace

absl::StatusOr<std::string> AskColmapVersion(const std::string& program, double timeout_seconds,
                                             const CancelToken& cancel) {
  SubprocessOptions child;
  child.args = {program, "help"};
  child.env = {"QT_QPA_PLATFORM=offscreen"};
  child.confined = true;
  child.timeout_seconds =
      timeout_seconds > 0 ? std::min(timeout_seconds, kMaxSeconds) : kMaxSeconds;
  std::string found;
  child.on_line = [&](std::string_view line) {
    if (found.empty() && !VersionIn(line).empty()) found = line;
  };
  LITAGS_ASSIGN_OR_RETURN(const SubprocessResult result, RunSubprocess(child, cancel));
  if (result.exit_code != 0 || found.empty()) {
    return MakeError(
        absl::StatusCode::kFailedPrecondition, "COLMAP_BROKEN", "colmap",
        absl::StrCat(program, " help ended with code ", result.exit_code, ": ", result.tail));
  }
  const std::string version(VersionIn(found));
  if (version != "3.8" && !version.starts_with("3.8.")) {
    return MakeError(
        absl::StatusCode::kFailedPrecondition, "COLMAP_UNSUPPORTED", "colmap",
        absl::StrCat("COLMAP \"", program, "\" is version ", version,
                     ", and 3.8 is needed: other versions name options "
                     "differently; install 3.8 (Debian 12: apt-get install colmap), or bring known "
                     "cameras with points"));
  }
  return found;
}

}  // namespace litags
