#include "server/worker/supervisor.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>
#include <cstdio>

#include "absl/strings/str_cat.h"
#include "engine/core/subprocess.h"
#include "server/store/digest.h"
#include "server/store/file_error.h"
#include "server/worker/hardening.h"

namespace litags {
namespace {

// More young deaths in a row than a job can cause, which is given up after three.
constexpr int kManyYoungDeaths = 4;

// Workers write whole log lines in the format of this process: passed on as they are.
void PassOn(std::string_view line) {
  const std::string text = absl::StrCat(std::string(line), "\n");
  std::fwrite(text.data(), 1, text.size(), stderr);
}

std::string WhyItEnded(const absl::StatusOr<SubprocessResult>& result) {
  if (!result.ok()) return std::string(result.status().message());
  if (result->exit_code == kOutOfMemoryExitCode) return "it ran out of memory";
  return absl::StrCat("it exited with code ", result->exit_code);
}

}  // namespace

Supervisor::Supervisor(SupervisorOptions options, Leases* leases)
    : options_(std::move(options)),
      leases_(leases),
      places_(static_cast<size_t>(options_.workers)) {
  for (int i = 0; i < options_.workers; ++i) {
    threads_.emplace_back([this, i] { KeepRunning(i); });
  }
}

Supervisor::~Supervisor() { Stop(); }

void Supervisor::Stop() {
  BeginStop();
  for (std::thread& thread : threads_) {
    if (thread.joinable()) thread.join();
  }
}

bool Supervisor::AllFailing() const {
  const auto now = SteadyClock::now();
  std::lock_guard lock(mutex_);
  return !places_.empty() && std::all_of(places_.begin(), places_.end(), [&](const Place& place) {
    const std::chrono::duration<double> age = now - place.start;
    return place.young_deaths >= kManyYoungDeaths && age.count() < options_.young_seconds;
  });
}

void Supervisor::KeepRunning(int index) {
  Place& place = places_[static_cast<size_t>(index)];
  double backoff = options_.min_backoff_seconds;
  while (!stop_.IsCancelled()) {
    // A new name per process: what the old one held can be told from what the new one holds.
    const std::string name = absl::StrCat("worker-", index, "-", RandomHex(4));
    SubprocessOptions child;
    child.args = options_.command;
    child.env = options_.env;
    child.args.insert(child.args.end(), {"--name", name});
    child.grace_seconds = options_.grace_seconds;
    child.niceness = options_.niceness;
    child.on_line = PassOn;
    const auto start = SteadyClock::now();
    {
      std::lock_guard lock(mutex_);
      place.start = start;
    }
    const auto result = RunSubprocess(child, stop_);
    const double lived = std::chrono::duration<double>(SteadyClock::now() - start).count();
    const std::string why = WhyItEnded(result);
    // One that was killed because its last checkpoint took longer than the grace was told to end.
    const absl::Status status =
        stop_.IsCancelled() ? leases_->WorkerStopped(name) : leases_->WorkerDied(name, why);
    if (!status.ok()) {
      spdlog::error("cannot take back the job of {}: {}", name, MessageWithReason(status));
    }
    if (stop_.IsCancelled()) return;

    const bool young = lived <= options_.young_seconds;
    {
      std::lock_guard lock(mutex_);
      place.young_deaths = young ? place.young_deaths + 1 : 0;
    }
    if (options_.on_restart) options_.on_restart();
    if (!young) backoff = options_.min_backoff_seconds;
    spdlog::warn("{} ended: {}; next one in {:.1f} s", name, why, backoff);
    stop_.SleepFor(backoff);
    backoff = std::min(2 * backoff, options_.max_backoff_seconds);
  }
}

}  // namespace litags
