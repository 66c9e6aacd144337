#include "server/api/shared_room.h"

namespace litags {

bool SharedRoom::IsFor(const std::string& client) {
  std::lock_guard lock(mutex_);
  const auto held = bytes_of_.find(client);
  return bytes_ < max_bytes_ && (held == bytes_of_.end() || held->second < max_bytes_ / 2);
}

void SharedRoom::Add(const std::string& client, int64_t bytes) {
  std::lock_guard lock(mutex_);
  bytes_ += bytes;
  int64_t& held = bytes_of_[client];
  held += bytes;
  if (held == 0) bytes_of_.erase(client);
}

}  // namespace litags
