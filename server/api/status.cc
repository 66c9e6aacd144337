#include "server/api/status.h"

#include <algorithm>
#include <string_view>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "engine/core/utf8.h"

namespace litags {
namespace {

constexpr size_t kJobIdLength = 16;

}  // namespace

absl::StatusOr<std::string> ParseJobName(const std::string& name) {
  constexpr std::string_view kPrefix = "jobs/";
  const std::string id = name.starts_with(kPrefix) ? name.substr(kPrefix.size()) : "";
  const auto is_id_char = [](char c) { return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'z'); };
  if (id.empty() || id.size() > kJobIdLength || !std::all_of(id.begin(), id.end(), is_id_char)) {
    return InvalidInput("JOB_NAME_INVALID", "name",
                        absl::StrCat("\"", Utf8Prefix(name, 100),
                                     "\" is not a job's name; names have the form jobs/ID, with "
                                     "the ID that CreateJob returned"));
  }
  return id;
}

absl::Status CallCancelled() { return absl::CancelledError("the call was cancelled"); }

absl::Status ShuttingDown() {
  return MakeError(absl::StatusCode::kUnavailable, "SHUTTING_DOWN", "",
                   "the server shuts down; try again in a moment");
}

absl::Status RenderQueueFull(size_t max_waiting) {
  return MakeError(absl::StatusCode::kResourceExhausted, "RENDER_QUEUE_FULL", "",
                   absl::StrCat(max_waiting,
                                " pictures wait to be rendered, and no more may; try again in a "
                                "second"));
}

absl::Status ServerBusy() {
  return MakeError(absl::StatusCode::kResourceExhausted, "SERVER_BUSY", "",
                   "too many calls wait for the job store; try again in a second");
}

}  // namespace litags
