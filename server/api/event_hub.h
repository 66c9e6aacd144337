#ifndef LITAGS_SERVER_API_EVENT_HUB_H_
#define LITAGS_SERVER_API_EVENT_HUB_H_

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <map>
#include <mutex>
#include <thread>

#include "server/jobs/jobs.h"

namespace litags {

// Tells watchers that something in the store changed, whichever process changed it. One thread
// waits for the store's changes; watchers then read what they need.
class EventHub {
 public:
  explicit EventHub(Jobs* jobs);
  ~EventHub();  // Stop()

  // `wake` is called after every change until Unsubscribe() returns. It must be quick and must not
  // call the hub.
  int64_t Subscribe(std::function<void()> wake);
  void Unsubscribe(int64_t id);

  // Wakes all watchers a last time, with stopping() true from then on, and gives them a second to
  // leave.
  void Stop();
  bool stopping() const { return stopping_.load(); }

 private:
  void Loop();
  void WakeAll();

  Jobs* const jobs_;
  std::atomic<bool> stopping_{false};
  std::mutex mutex_;
  int64_t next_id_ = 1;
  std::map<int64_t, std::function<void()>> watchers_;
  std::condition_variable empty_;
  std::thread thread_;
};

}  // namespace litags

#endif  // LITAGS_SERVER_API_EVENT_HUB_H_
