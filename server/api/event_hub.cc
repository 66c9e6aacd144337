#include "server/api/event_hub.h"

#include <spdlog/spdlog.h>

#include <chrono>

#include "server/store/file_error.h"

namespace litags {
namespace {

// How soon the hub's end is noticed.
constexpr double kStepSeconds = 0.1;
constexpr std::chrono::milliseconds kPauseAfterError{500};
constexpr std::chrono::seconds kStopGrace{1};

}  // namespace

EventHub::EventHub(Jobs* jobs) : jobs_(jobs), thread_([this] { Loop(); }) {}

EventHub::~EventHub() { Stop(); }

int64_t EventHub::Subscribe(std::function<void()> wake) {
  std::lock_guard lock(mutex_);
  watchers_.emplace(next_id_, std::move(wake));
  return next_id_++;
}

void EventHub::Unsubscribe(int64_t id) {
  std::lock_guard lock(mutex_);
  watchers_.erase(id);
  if (watchers_.empty()) empty_.notify_all();
}

void EventHub::Stop() {
  if (stopping_.exchange(true)) return;
  thread_.join();
  WakeAll();
  std::unique_lock lock(mutex_);
  empty_.wait_for(lock, kStopGrace, [this] { return watchers_.empty(); });
}

void EventHub::Loop() {
  int64_t last = -1;
  while (!stopping()) {
    const auto token = jobs_->WaitForChange(last, kStepSeconds);
    if (!token.ok()) {
      spdlog::error("cannot look for events: {}", MessageWithReason(token.status()));
      std::this_thread::sleep_for(kPauseAfterError);
    } else if (*token != last) {
      last = *token;
      WakeAll();
    }
  }
}

void EventHub::WakeAll() {
  std::lock_guard lock(mutex_);
  for (const auto& [id, wake] : watchers_) wake();
}

}  // namespace litags
