// Progress of a loop over photos on several threads.
#ifndef LITAGS_ENGINE_PIPELINE_PHOTO_PROGRESS_H_
#define LITAGS_ENGINE_PIPELINE_PHOTO_PROGRESS_H_

#include <atomic>
#include <chrono>
#include <functional>
#include <string>
#include <utility>

#include "absl/strings/str_cat.h"

namespace litags {

// "reading photos: 12 of 300", now and then.
class PhotoProgress {
 public:
  // `report` may be empty; it is called at most every `seconds`.
  PhotoProgress(std::function<void(const std::string&)> report, std::string what, size_t total,
                double seconds = 1)
      : report_(std::move(report)), what_(std::move(what)), total_(total), every_(seconds) {}

  // One more photo is done, by `thread` of ParallelFor. Reports come from thread 0, the caller's.
  void Done(int thread) {
    const size_t done = ++done_;
    if (thread != 0 || !report_) return;
    const auto now = std::chrono::steady_clock::now();
    if (now - last_ < every_) return;
    last_ = now;
    report_(absl::StrCat(what_, ": ", done, " of ", total_));
  }

 private:
  const std::function<void(const std::string&)> report_;
  const std::string what_;
  const size_t total_;
  const std::chrono::duration<double> every_;
  std::atomic<size_t> done_ = 0;
  std::chrono::steady_clock::time_point last_ = std::chrono::steady_clock::now();  // thread 0's
};

}  // namespace litags

#endif  // LITAGS_ENGINE_PIPELINE_PHOTO_PROGRESS_H_
