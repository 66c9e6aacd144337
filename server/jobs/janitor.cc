#include "server/jobs/janitor.h"

#include <spdlog/spdlog.h>

#include <chrono>

namespace litags {
namespace {

// How soon the end of the janitor is noticed.
constexpr std::chrono::milliseconds kStep{50};

}  // namespace

Janitor::Janitor(Jobs* jobs, double interval_seconds)
    : jobs_(jobs), thread_([this, interval_seconds] { Loop(interval_seconds); }) {}

Janitor::~Janitor() {
  stop_.Cancel();
  thread_.join();
}

void Janitor::Loop(double interval_seconds) {
  while (!stop_.IsCancelled()) {
    const absl::Status swept = jobs_->Sweep(stop_).status();
    if (!swept.ok()) spdlog::error("cannot tidy up: {}", swept.ToString());
    const auto next =
        std::chrono::steady_clock::now() + std::chrono::duration<double>(interval_seconds);
    while (!stop_.IsCancelled() && std::chrono::steady_clock::now() < next) {
      std::this_thread::sleep_for(kStep);
    }
  }
}

}  // namespace litags
