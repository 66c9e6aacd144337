#include "server/net/shared_room.h"

namespace litags {

bool SharedRoom::IsFor(const std::string& client) {
  std::lock_guard lock(mutex_);
  const auto held = held_by_.find(client);
  return held_ < most_ && (held == held_by_.end() || held->second < most_ / 2);
}

void SharedRoom::Add(const std::string& client, int64_t amount) {
  std::lock_guard lock(mutex_);
  held_ += amount;
  int64_t& held = held_by_[client];
  held += amount;
  if (held == 0) held_by_.erase(client);
}

}  // namespace litags
