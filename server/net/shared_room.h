#ifndef LITAGS_SERVER_NET_SHARED_ROOM_H_
#define LITAGS_SERVER_NET_SHARED_ROOM_H_

#include <cstdint>
#include <map>
#include <mutex>
#include <string>
#include <utility>

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

// An amount of a room, which must outlive this; given back when this is gone.
class HeldRoom {
 public:
  HeldRoom() = default;
  HeldRoom(SharedRoom* room, std::string client, int64_t amount)
      : room_(room), client_(std::move(client)), amount_(amount) {
    room_->Add(client_, amount_);
  }
  HeldRoom(HeldRoom&& other) noexcept { Swap(other); }
  HeldRoom& operator=(HeldRoom&& other) noexcept {
    HeldRoom taken(std::move(other));
    Swap(taken);
    return *this;
  }
  ~HeldRoom() {
    if (room_) room_->Add(client_, -amount_);
  }

 private:
  void Swap(HeldRoom& other) {
    std::swap(room_, other.room_);
    client_.swap(other.client_);
    std::swap(amount_, other.amount_);
  }

  SharedRoom* room_ = nullptr;
  std::string client_;
  int64_t amount_ = 0;
};

// The header by which an answer in process says whose room it takes.
inline constexpr char kRoomOfHeader[] = "litags-room-of";

}  // namespace litags

#endif  // LITAGS_SERVER_NET_SHARED_ROOM_H_
