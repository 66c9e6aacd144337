#ifndef LITAGS_SERVER_API_SHARED_ROOM_H_
#define LITAGS_SERVER_API_SHARED_ROOM_H_

#include <cstdint>
#include <map>
#include <mutex>
#include <string>

namespace litags {

// Bytes of which all clients together may hold so many, and one of them half. Asked before
// something is made, and told its size after, so that what is in the making may go beyond.
// Thread-safe.
class SharedRoom {
 public:
  explicit SharedRoom(int64_t max_bytes) : max_bytes_(max_bytes) {}

  bool IsFor(const std::string& client);
  // `bytes` below 0: given back.
  void Add(const std::string& client, int64_t bytes);

 private:
  const int64_t max_bytes_;
  std::mutex mutex_;
  int64_t bytes_ = 0;                        // of all clients
  std::map<std::string, int64_t> bytes_of_;  // without those that hold none
};

}  // namespace litags

#endif  // LITAGS_SERVER_API_SHARED_ROOM_H_
