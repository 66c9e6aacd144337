#include "server/worker/presence.h"

#include <chrono>

#include "server/jobs/codec.h"

namespace litags {
namespace {

using SteadyClock = std::chrono::steady_clock;

constexpr std::chrono::milliseconds kStep{50};
// Said again in time although one try fails.
constexpr std::chrono::milliseconds kEvery{kWorkerSilenceMs / 3};
constexpr std::chrono::milliseconds kAfterFailure{1000};

}  // namespace

WorkerPresence::WorkerPresence(JobStore* store, std::string name, const Resources& has)
    : store_(store), name_(std::move(name)), resources_(Encode(has)), thread_([this] { Loop(); }) {}

WorkerPresence::~WorkerPresence() {
  stop_.Cancel();
  thread_.join();
  store_->RemoveWorker(name_).IgnoreError();  // else it is forgotten a little later
}

void WorkerPresence::Loop() {
  while (!stop_.IsCancelled()) {
    const absl::Status status = store_->PutWorker({name_, store_->NowMs(), resources_});
    const auto until = SteadyClock::now() + (status.ok() ? kEvery : kAfterFailure);
    while (!stop_.IsCancelled() && SteadyClock::now() < until) std::this_thread::sleep_for(kStep);
  }
}

}  // namespace litags
