#include "server/store/postgres_listener.h"

#include <chrono>

#include "absl/strings/str_cat.h"
#include "engine/core/error.h"
#include "server/store/postgres.h"

namespace litags {
namespace {

constexpr double kReconnectAfterSeconds = 0.3;
constexpr double kStepSeconds = 0.1;  // how soon the end is noticed

absl::StatusOr<std::string> Snapshot(PgConnection* connection) {
  const auto row = connection->Prepare("SELECT pg_current_snapshot()::text");
  LITAGS_RETURN_IF_ERROR(row->Step().status());
  return row->Text(0);
}

}  // namespace

PgListener::PgListener(std::string url, ChangeTopic topic, double look_every_seconds)
    : url_(std::move(url)),
      topic_(topic),
      look_every_ms_(static_cast<int64_t>(1000 * look_every_seconds)),
      thread_([this] { Loop(); }) {}

PgListener::~PgListener() {
  {
    std::lock_guard lock(mutex_);
    ends_ = true;
  }
  changed_.notify_all();
  thread_.join();
}

int64_t PgListener::Wait(int64_t seen, double seconds) {
  std::unique_lock lock(mutex_);
  changed_.wait_for(lock, std::chrono::duration<double>(seconds),
                    [&] { return changes_ != seen || ends_; });
  return changes_;
}

void PgListener::NoteChange() {
  {
    std::lock_guard lock(mutex_);
    ++changes_;
  }
  changed_.notify_all();
}

bool PgListener::Ends(double seconds) {
  std::unique_lock lock(mutex_);
  return changed_.wait_for(lock, std::chrono::duration<double>(seconds), [this] { return ends_; });
}

void PgListener::Loop() {
  while (!Ends(0)) {
    // Errors are seen by those who use the store; here they only mean to try again.
    Listen().IgnoreError();
    if (Ends(kReconnectAfterSeconds)) return;
  }
}

absl::Status PgListener::Listen() {
  LITAGS_ASSIGN_OR_RETURN(const auto connection, PgConnection::Open(url_));
  LITAGS_RETURN_IF_ERROR(connection->Execute(absl::StrCat("LISTEN ", ChannelOf(topic_))));
  LITAGS_ASSIGN_OR_RETURN(std::string last, Snapshot(connection.get()));
  NoteChange();  // of what came while nobody listened
  int64_t look_at_ms = MonotonicMs() + look_every_ms_;
  while (!Ends(0)) {
    LITAGS_ASSIGN_OR_RETURN(const bool notified, connection->WaitForNotification(kStepSeconds));
    if (notified) NoteChange();
    if (MonotonicMs() < look_at_ms) continue;
    look_at_ms = MonotonicMs() + look_every_ms_;
    LITAGS_ASSIGN_OR_RETURN(std::string now, Snapshot(connection.get()));
    if (now == last) continue;
    last = std::move(now);
    NoteChange();
  }
  return absl::OkStatus();
}

}  // namespace litags
