#include <chrono>

#include "server/store/job_store.h"

namespace litags {

int64_t SystemClockMs() {
  return std::chrono::duration_cast<std::chrono::milliseconds>(
             std::chrono::system_clock::now().time_since_epoch())
      .count();
}

int64_t AwakeClockMs() {
  return std::chrono::duration_cast<std::chrono::milliseconds>(
             std::chrono::steady_clock::now().time_since_epoch())
      .count();
}

Clock StoreClock(ClientStore* store) {
  return [store] { return store->NowMs(); };
}

}  // namespace litags
