#include "server/worker/presence.h"

#include <chrono>

#include "server/jobs/codec.h"

namespace litags {
namespace {

// Said again in time although one try fails.
constexpr std::chrono::milliseconds kEvery{kWorkerSilenceMs / 3};
constexpr std::chrono::milliseconds kAfterFailure{1000};

}  // namespace

WorkerPresence::WorkerPresence(JobStore* store, std::string name, const Resources& has)
    : store_(store),
      name_(std::move(name)),
      resources_(Encode(has)),
      thread_([this](std::stop_token stop) { Loop(stop); }) {}

WorkerPresence::~WorkerPresence() {
  thread_.request_stop();
  thread_.join();
  store_->RemoveWorker(name_).IgnoreError();  // else it is forgotten a little later
}

void WorkerPresence::Loop(std::stop_token stop) {
  while (!stop.stop_requested()) {
    const absl::Status status = store_->PutWorker({name_, store_->NowMs(), resources_});
    std::unique_lock lock(mutex_);
    wake_.wait_for(lock, stop, status.ok() ? kEvery : kAfterFailure, [] { return false; });
  }
}

}  // namespace litags
