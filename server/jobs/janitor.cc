#include "server/jobs/janitor.h"

#include <spdlog/spdlog.h>

#include "server/store/file_error.h"

namespace litags {

Janitor::Janitor(Sweeper* sweeper, double interval_seconds)
    : sweeper_(sweeper), thread_([this, interval_seconds] { Loop(interval_seconds); }) {}

Janitor::~Janitor() {
  stop_.Cancel();
  thread_.join();
}

void Janitor::Loop(double interval_seconds) {
  while (!stop_.IsCancelled()) {
    const absl::Status swept = sweeper_->Sweep(stop_).status();
    if (!swept.ok()) spdlog::error("cannot tidy up: {}", MessageWithReason(swept));
    stop_.SleepFor(interval_seconds);
  }
}

}  // namespace litags
