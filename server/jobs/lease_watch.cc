#include "server/jobs/lease_watch.h"

#include <spdlog/spdlog.h>

#include "server/store/file_error.h"

namespace litags {
namespace {

constexpr double kSecondsBetweenLooks = 2;

}  // namespace

LeaseWatch::LeaseWatch(Leases* leases) : leases_(leases), thread_([this] { Loop(); }) {}

LeaseWatch::~LeaseWatch() {
  stop_.Cancel();
  thread_.join();
}

void LeaseWatch::Loop() {
  bool failed = false;  // said once
  while (!stop_.IsCancelled()) {
    const absl::Status status = leases_->TakeBackLost();
    if (!status.ok() && !failed) {
      spdlog::error("cannot take back jobs of lost workers: {}", MessageWithReason(status));
    }
    failed = !status.ok();
    stop_.SleepFor(kSecondsBetweenLooks);
  }
}

}  // namespace litags
