#include "server/net/line_rate.h"

#include "absl/strings/str_cat.h"

namespace litags {
namespace {

// Enough to see what happens; at most 8 MB of log an hour from one kind.
constexpr int kLines = 20;
constexpr std::chrono::seconds kWindow{10};
// Beyond so many kinds at one time, as of a thousand addresses, all new ones are one.
constexpr size_t kKinds = 200;
constexpr std::string_view kOthers = "others";

}  // namespace

bool LineRate::Pass(std::string_view name, std::string* ending, Clock::time_point now) {
  std::lock_guard lock(mutex_);
  auto found = kinds_.find(name);
  if (found == kinds_.end()) {
    if (kinds_.size() >= kKinds) {
      std::erase_if(kinds_, [&](const auto& kind) { return now - kind.second.begin > kWindow; });
    }
    if (kinds_.size() >= kKinds) name = kOthers;
    found = kinds_.try_emplace(std::string(name), Kind{now}).first;
  }
  Kind& kind = found->second;
  if (now - kind.begin > kWindow) {
    kind.begin = now;
    kind.lines = 0;
  }
  if (kind.lines >= kLines) {
    ++kind.skipped;
    return false;
  }
  ++kind.lines;
  *ending =
      kind.skipped > 0 ? absl::StrCat(" (", kind.skipped, " more like it were left out)") : "";
  kind.skipped = 0;
  return true;
}

LineRate& CallerLines() {
  static LineRate rate;
  return rate;
}

}  // namespace litags
