#ifndef LITAGS_SERVER_API_CPU_BUDGET_H_
#define LITAGS_SERVER_API_CPU_BUDGET_H_

#include <chrono>
#include <map>
#include <mutex>
#include <string>

namespace litags {

// What the uploads of one client may take of the processor: to unpack, to decode, to hash. Counted
// when it is known, after each step, whatever the bytes were. The time that another process reads
// a file counts as if that had a core for itself.
struct UploadCpuLimits {
  double per_second = 1;       // seconds of one core, each second; 0: no limit
  double burst_seconds = 120;  // so many at once after a pause: 500 photos of 24 megapixels
};

// Thread-safe.
class CpuBudget {
 public:
  explicit CpuBudget(UploadCpuLimits limits) : limits_(limits) {}

  // Until this client may take another step; 0: now.
  double SecondsToWait(const std::string& client);
  // A step of this client took so much.
  void Spend(const std::string& client, double seconds);

 private:
  using SteadyClock = std::chrono::steady_clock;
  struct Account {
    double seconds = 0;  // left; below 0 when the last step was a long one
    SteadyClock::time_point counted;
  };

  double Left(const Account& account, SteadyClock::time_point now) const;

  const UploadCpuLimits limits_;
  std::mutex mutex_;
  std::map<std::string, Account> accounts_;  // without those that are full
};

// That this thread has taken so far.
double ThreadCpuSeconds();

}  // namespace litags

#endif  // LITAGS_SERVER_API_CPU_BUDGET_H_
