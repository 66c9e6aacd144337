#ifndef LITAGS_SERVER_NET_LINE_RATE_H_
#define LITAGS_SERVER_NET_LINE_RATE_H_

#include <chrono>
#include <map>
#include <mutex>
#include <string>
#include <string_view>

namespace litags {

// What strangers can make the server say again and again is said at a bounded rate. Thread-safe.
class LineRate {
 public:
  using Clock = std::chrono::steady_clock;

  // Whether a line of this kind is to be written; if so, `ending` is what to write at its end:
  // nothing, or how many like it were left out since the last.
  bool Pass(std::string_view kind, std::string* ending, Clock::time_point now = Clock::now());

 private:
  struct Kind {
    Clock::time_point begin;
    int lines = 0;    // in this window
    int skipped = 0;  // since the last line
  };

  std::mutex mutex_;
  std::map<std::string, Kind, std::less<>> kinds_;
};

// The one for lines about callers and connections.
LineRate& CallerLines();

}  // namespace litags

#endif  // LITAGS_SERVER_NET_LINE_RATE_H_
