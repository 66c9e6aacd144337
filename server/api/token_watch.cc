#include "server/api/token_watch.h"

#include "server/auth/file_stamp.h"

namespace litags {

TokenWatch::TokenWatch(Authenticator* authenticator)
    : authenticator_(authenticator), thread_([this] { Loop(); }) {}

TokenWatch::~TokenWatch() {
  {
    std::lock_guard lock(mutex_);
    stop_ = true;
    wake_.notify_all();
  }
  thread_.join();
}

TokenWatch::Ticket TokenWatch::Add(std::function<void()> look) {
  Ticket ticket;
  std::lock_guard lock(mutex_);
  ticket.watch_ = this;
  ticket.id_ = next_id_++;
  looks_.emplace(ticket.id_, std::move(look));
  return ticket;
}

void TokenWatch::Forget(int64_t id) {
  std::lock_guard lock(mutex_);
  looks_.erase(id);
}

void TokenWatch::Loop() {
  int64_t last = authenticator_->Generation();
  std::unique_lock lock(mutex_);
  while (!wake_.wait_for(lock, kLookInterval, [this] { return stop_; })) {
    const int64_t now = authenticator_->Generation();
    if (now == last) continue;
    last = now;
    for (const auto& [id, look] : looks_) look();
  }
}

}  // namespace litags
