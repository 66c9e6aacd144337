#include "server/api/cpu_budget.h"

#include <time.h>

#include <algorithm>

namespace litags {

double CpuBudget::Left(const Account& account, SteadyClock::time_point now) const {
  const std::chrono::duration<double> since = now - account.counted;
  return std::min(limits_.burst_seconds, account.seconds + since.count() * limits_.per_second);
}

double CpuBudget::SecondsToWait(const std::string& client) {
  std::lock_guard lock(mutex_);
  const auto account = accounts_.find(client);
  if (account == accounts_.end()) return 0;
  return std::max(0.0, -Left(account->second, SteadyClock::now()) / limits_.per_second);
}

void CpuBudget::Spend(const std::string& client, double seconds) {
  if (limits_.per_second <= 0) return;
  const auto now = SteadyClock::now();
  std::lock_guard lock(mutex_);
  std::erase_if(accounts_, [&](const auto& entry) {
    return Left(entry.second, now) >= limits_.burst_seconds;
  });
  Account& account =
      accounts_.try_emplace(client, Account{limits_.burst_seconds, now}).first->second;
  account = {Left(account, now) - seconds, now};
}

double ThreadCpuSeconds() {
  timespec time{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return static_cast<double>(time.tv_sec) + 1e-9 * static_cast<double>(time.tv_nsec);
}

}  // namespace litags
