#ifndef LITAGS_SERVER_WORKER_WHILE_AWAY_H_
#define LITAGS_SERVER_WORKER_WHILE_AWAY_H_

#include <spdlog/spdlog.h>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "engine/core/cancel.h"
#include "server/store/file_error.h"

namespace litags {

inline const absl::Status& StatusOf(const absl::Status& status) { return status; }
template <typename T>
const absl::Status& StatusOf(const absl::StatusOr<T>& result) {
  return result.status();
}

inline bool IsAway(const absl::Status& status) { return absl::IsUnavailable(status); }

// Repeats a call to a store that is away until it is back, or `stop` is raised; then once more, and
// what that says. A job that ran for hours does not fail because a database restarts.
template <typename Call>
auto WhileAway(const CancelToken& stop, Call call, bool (*is_away)(const absl::Status&) = IsAway) {
  constexpr double kPauseSeconds = 0.5;
  for (bool logged = false;; logged = true) {
    auto result = call();
    if (!is_away(StatusOf(result))) return result;
    if (!logged) spdlog::warn("waiting for the store: {}", MessageWithReason(StatusOf(result)));
    stop.SleepFor(kPauseSeconds);
    if (stop.IsCancelled()) return call();
  }
}

}  // namespace litags

#endif  // LITAGS_SERVER_WORKER_WHILE_AWAY_H_
