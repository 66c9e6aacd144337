#ifndef LITAGS_SERVER_TESTING_EVENTUALLY_H_
#define LITAGS_SERVER_TESTING_EVENTUALLY_H_

#include <chrono>
#include <thread>

namespace litags {

// Whether `condition` becomes true within so many seconds; looks every 10 ms.
template <typename Condition>
bool Eventually(Condition condition, double seconds = 20) {
  using Clock = std::chrono::steady_clock;
  const auto end = Clock::now() + std::chrono::duration<double>(seconds);
  while (!condition()) {
    if (Clock::now() >= end) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  return true;
}

}  // namespace litags

#endif  // LITAGS_SERVER_TESTING_EVENTUALLY_H_
