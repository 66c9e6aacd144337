#ifndef LITAGS_SERVER_TESTING_EVENTUALLY_H_
#define LITAGS_SERVER_TESTING_EVENTUALLY_H_

#include <chrono>
#include <thread>

namespace litags {

// Whether `condition` becomes true within 20 seconds; looks every 10 ms.
template <typename Condition>
bool Eventually(Condition condition) {
  using Clock = std::chrono::steady_clock;
  const auto end = Clock::now() + std::chrono::seconds(20);
  while (!condition()) {
    if (Clock::now() >= end) return false;
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  return true;
}

}  // namespace litags

#endif  // LITAGS_SERVER_TESTING_EVENTUALLY_H_
