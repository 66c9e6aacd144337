#ifndef LITAGS_SERVER_API_TOKEN_WATCH_H_
#define LITAGS_SERVER_API_TOKEN_WATCH_H_

#include <condition_variable>
#include <cstdint>
#include <functional>
#include <map>
#include <mutex>
#include <thread>
#include <utility>

#include "server/auth/authenticator.h"

namespace litags {

// Tells open streams that tokens have changed, so that one whose token was taken back ends although
// its client says nothing. Looks once a second. Thread-safe.
class TokenWatch {
 public:
  explicit TokenWatch(Authenticator* authenticator);  // outlives this
  ~TokenWatch();                                      // no ticket may be left

  // While it is there, its function is called; its end waits for one that runs.
  class Ticket {
   public:
    Ticket() = default;
    ~Ticket() {
      if (watch_) watch_->Forget(id_);
    }
    Ticket(Ticket&& other) noexcept { *this = std::move(other); }
    Ticket& operator=(Ticket&& other) noexcept {
      std::swap(watch_, other.watch_);
      std::swap(id_, other.id_);
      return *this;
    }

   private:
    friend class TokenWatch;
    TokenWatch* watch_ = nullptr;
    int64_t id_ = 0;
  };

  // `look` must be quick and must not end its ticket.
  Ticket Add(std::function<void()> look);

 private:
  void Loop();
  void Forget(int64_t id);

  Authenticator* const authenticator_;
  std::mutex mutex_;
  std::condition_variable wake_;
  bool stop_ = false;
  int64_t next_id_ = 1;
  std::map<int64_t, std::function<void()>> looks_;
  std::thread thread_;
};

}  // namespace litags

#endif  // LITAGS_SERVER_API_TOKEN_WATCH_H_
