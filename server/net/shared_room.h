#ifndef LITAGS_SERVER_NET_SHARED_ROOM_H_
#define LITAGS_SERVER_NET_SHARED_ROOM_H_

#include <cstdint>
#include <map>
#include <mutex>
#include <string>

namespace litags {

// Something, bytes for instance, of which all clients together may hold so much, and one of them
// half. Asked before something is made, and told its size after, so that what is in the making may
// go beyond. Thread-safe.
class SharedRoom {
 public:
  explicit SharedRoom(int64_t most) : most_(most) {}

  bool IsFor(const std::string& client);
  // `amount` below 0: given back.
  void Add(const std::string& client, int64_t amount);

 private:
  const int64_t most_;
  std::mutex mutex_;
  int64_t held_ = 0;                        // by all clients
  std::map<std::string, int64_t> held_by_;  // without those that hold nothing
};

}  // namespace litags

#endif  // LITAGS_SERVER_NET_SHARED_ROOM_H_
