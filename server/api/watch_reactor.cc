#include "server/api/watch_reactor.h"

#include <utility>

#include "absl/strings/str_cat.h"
#include "server/api/convert.h"
#include "server/jobs/state_machine.h"

namespace litags {

WatchReactor::WatchReactor(std::shared_ptr<Call> call, grpc::CallbackServerContext* context,
                           const v1::WatchJobRequest& request, EventHub* hub, ThreadPool* pool)
    : FollowStream(std::move(call), context, request.name(), hub, pool), request_(request) {
  Begin();
}

absl::StatusOr<int64_t> WatchReactor::First(const JobRecord& job) {
  const int64_t after = request_.after_event();
  if (after < 0) {
    return InvalidInput(
        "EVENT_NUMBER_INVALID", "after_event",
        absl::StrCat("after_event is ", after, "; it is the number of an event, or 0 for all"));
  }
  if (after > job.last_event) {
    return MakeError(absl::StatusCode::kOutOfRange, "EVENT_NOT_YET", "after_event",
                     absl::StrCat("after_event is ", after, ", but the job's events go from 1 to ",
                                  job.last_event, "; give the number of the last event seen"));
  }
  return after;
}

absl::StatusOr<std::vector<EventRecord>> WatchReactor::Read(const std::string& job_id,
                                                            int64_t after) {
  return jobs().Events(job_id, after, kRecordsPerRead);
}

absl::StatusOr<v1::JobEvent> WatchReactor::Fill(const std::string& job_id,
                                                const EventRecord& event) {
  std::string preview;
  LITAGS_ASSIGN_OR_RETURN(v1::JobEvent message, EventToProto(event, &preview));
  if (request_.include_previews() && !preview.empty() && call().CheckRoom().ok()) {
    LITAGS_ASSIGN_OR_RETURN(*message.mutable_progress()->mutable_preview_png(),
                            jobs().Preview(job_id, preview));
  }
  return message;
}

bool WatchReactor::IsOver(const JobRecord& job, int64_t last) const {
  return IsTerminal(job.state) && job.last_event == last;
}

LogReactor::LogReactor(std::shared_ptr<Call> call, grpc::CallbackServerContext* context,
                       const v1::GetLogRequest& request, EventHub* hub, ThreadPool* pool)
    : FollowStream(std::move(call), context, request.name(), hub, pool), request_(request) {
  Begin();
}

absl::StatusOr<int64_t> LogReactor::First(const JobRecord& job) {
  const int64_t after = request_.after_entry();
  if (after < 0) {
    return InvalidInput(
        "LOG_ENTRY_INVALID", "after_entry",
        absl::StrCat("after_entry is ", after, "; it is the number of an entry, or 0 for all"));
  }
  if (after > job.last_log_entry) {
    return MakeError(absl::StatusCode::kOutOfRange, "LOG_ENTRY_NOT_YET", "after_entry",
                     absl::StrCat("after_entry is ", after, ", but the log's entries go from 1 to ",
                                  job.last_log_entry, "; give the number of the last entry seen"));
  }
  return after;
}

absl::StatusOr<std::vector<LogEntry>> LogReactor::Read(const std::string& job_id, int64_t after) {
  return jobs().Log(job_id, after, kRecordsPerRead);
}

absl::StatusOr<v1::LogEntry> LogReactor::Fill(const std::string&, const LogEntry& entry) {
  return LogEntryToProto(entry);
}

bool LogReactor::IsOver(const JobRecord& job, int64_t last) const {
  return (!request_.follow() || IsTerminal(job.state)) && job.last_log_entry <= last;
}

}  // namespace litags
