// litags-store-bench: what a job store does under many synthetic workers. They take jobs, report,
// renew and finish as litags-worker does, and train nothing.
//
//   litags-store-bench sqlite postgres --workers 16 --jobs 2000
#include <sys/resource.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdio>
#include <fstream>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

#include "absl/strings/str_cat.h"
#include "engine/core/monotonic_seconds.h"
#include "engine/core/temp_dir_test_util.h"
#include "server/jobs/codec.h"
#include "server/jobs/leases.h"
#include "server/testing/postgres_server.h"

namespace litags {
namespace {

using SteadyClock = std::chrono::steady_clock;

struct BenchOptions {
  int workers = 16;
  int leases = 0;  // held at the same time by as many fleet workers, over `workers` connections
  int jobs = 2000;
  int waiting = 20000;  // further jobs in the queue, of lower priority, so that it has a length
  int clients = 20;
  int reports = 5;  // per job, beside its start and its end
  int latencies = 500;
  double seconds = 5;
};

template <typename T>
T Need(absl::StatusOr<T> result) {
  if (!result.ok()) {
    std::fprintf(stderr, "%s\n", result.status().ToString().c_str());
    std::exit(1);
  }
  return *std::move(result);
}
void Need(const absl::Status& status) {
  if (!status.ok()) Need<int>(status);
}

// One kind of store: opened once by every worker, as by so many processes.
struct Kind {
  std::string name;
  std::function<std::unique_ptr<JobStore>()> open;
  std::function<double()> server_cpu;  // seconds of processes beside this one
};

double OwnCpu() {
  rusage usage;
  getrusage(RUSAGE_SELF, &usage);
  const auto seconds = [](const timeval& t) {
    return static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_usec);
  };
  return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

// Of a process and those of its children that have ended, /proc/PID/stat.
double CpuOf(pid_t pid) {
  std::ifstream file(absl::StrCat("/proc/", pid, "/stat"));
  std::string text((std::istreambuf_iterator<char>(file)), {});
  std::istringstream fields(text.substr(text.rfind(')') + 1));
  std::string skipped;
  for (int i = 3; i < 14; ++i) fields >> skipped;
  double ticks = 0, value = 0;  // utime, stime, cutime, cstime
  for (int i = 0; i < 4 && fields >> value; ++i) ticks += value;
  return ticks / static_cast<double>(sysconf(_SC_CLK_TCK));
}

// How long a piece of work took, on the clock and in processors.
class Measurement {
 public:
  explicit Measurement(const Kind& kind) : kind_(kind) {}
  void Print(const char* what, double count, const char* unit) const {
    const double wall = MonotonicSeconds() - start_, own = OwnCpu() - own_;
    const double server = kind_.server_cpu() - server_;
    std::printf(
        "%-9s %-28s %8.0f %s/s   %7.1f s wall, %6.2f s CPU of workers, %6.2f s of the "
        "database\n",
        kind_.name.c_str(), what, count / wall, unit, wall, own, server);
    std::fflush(stdout);
  }

 private:
  const Kind& kind_;
  const double start_ = MonotonicSeconds();
  const double own_ = OwnCpu();
  const double server_ = kind_.server_cpu();
};

// Runs `work(store, index)` on so many threads, each with a store of its own.
void OnThreads(const Kind& kind, int count, const std::function<void(JobStore*, int)>& work) {
  std::vector<std::thread> threads;
  for (int i = 0; i < count; ++i) {
    threads.emplace_back([&, i] {
      const auto store = kind.open();
      work(store.get(), i);
    });
  }
  for (std::thread& thread : threads) thread.join();
}

JobRecord QueuedJob(const std::string& id, const std::string& owner, int priority, int64_t now_ms) {
  JobRecord job;
  job.id = id;
  job.owner = owner;
  job.state = JobState::kQueued;
  job.priority = priority;
  job.create_time_ms = job.queue_time_ms = now_ms;
  job.options = Encode(ReconstructOptions());
  job.policy = Encode(JobPolicy());
  return job;
}

void Fill(const Kind& kind, const BenchOptions& options) {
  const Measurement measurement(kind);
  std::atomic<int> next{0};
  const int total = options.jobs + options.leases + options.waiting;
  OnThreads(kind, 4, [&](JobStore* store, int) {
    for (int i; (i = next++) < total;) {
      const bool waits = i >= total - options.waiting;
      const auto job =
          QueuedJob(absl::StrCat("job", i), absl::StrCat("client", i % options.clients),
                    waits ? -1 : 0, store->NowMs());
      Need(store->Create(job, [](JobTransaction&) { return absl::OkStatus(); }).status());
    }
  });
  measurement.Print("jobs created", total, "jobs");
}

Progress ProgressOf(int iteration) {
  Progress progress;
  progress.iteration = iteration;
  return progress;
}

// Jobs from the queue to their end, each with a lease, reports, one renewal and an end.
void MeasureLeases(const Kind& kind, const BenchOptions& options, BlobStore* blobs) {
  const Measurement measurement(kind);
  std::atomic<int> done{0};
  OnThreads(kind, options.workers, [&](JobStore* store, int index) {
    Leases leases(store, blobs);
    const std::string name = absl::StrCat("worker", index);
    while (done < options.jobs) {
      const auto lease = Need(leases.Acquire(name));
      if (!lease) continue;  // others are taking the last ones
      for (int i = 1; i <= options.reports; ++i) Need(leases.AddProgress(*lease, ProgressOf(i)));
      Need(leases.Heartbeat(*lease, 0).status());
      Need(leases.Stopped(*lease));
      ++done;
    }
  });
  measurement.Print("jobs taken, run and ended", done, "jobs");
  measurement.Print("transactions of theirs", 1.0 * done * (options.reports + 3), "commits");
}

// Workers that only report, each about a job of its own.
void MeasureEvents(const Kind& kind, const BenchOptions& options, BlobStore* blobs) {
  const Measurement measurement(kind);
  std::atomic<int64_t> events{0};
  const auto end = SteadyClock::now() + std::chrono::duration<double>(options.seconds);
  OnThreads(kind, options.workers, [&](JobStore* store, int index) {
    Leases leases(store, blobs);
    const auto lease = Need(leases.Acquire(absl::StrCat("reporter", index)));
    for (int i = 1; lease && SteadyClock::now() < end; ++i) {
      Need(leases.AddProgress(*lease, ProgressOf(i)));
      ++events;
    }
    if (lease) Need(leases.GiveBack(*lease, 0));
  });
  measurement.Print("events written", static_cast<double>(events.load()), "events");
}

// A fleet of workers at their own pace (WorkerOptions): each looks for cancellation four times a
// second, reports once, and renews its lease every other second. How late they get says when the
// store has enough.
class Fleet {
 public:
  Fleet(const Kind& kind, const BenchOptions& options, BlobStore* blobs)
      : kind_(kind), options_(options), blobs_(blobs) {}

  void Measure() {
    const int connections = std::min(options_.workers, options_.leases);
    OnThreads(kind_, connections, [&](JobStore* store, int index) { Run(store, index); });
    std::sort(late_ms_.begin(), late_ms_.end());
    measurement_->Print(absl::StrCat("commits of ", options_.leases, " leases").c_str(),
                        static_cast<double>(commits_), "commits");
    std::printf("%-9s %-28s %lld lost; rounds end late by %.0f ms (p50), %.0f ms (p99)\n",
                kind_.name.c_str(), "of these leases", static_cast<long long>(lost_),
                late_ms_[late_ms_.size() / 2], late_ms_[late_ms_.size() * 99 / 100]);
  }

 private:
  static constexpr std::chrono::milliseconds kRound{250};
  static constexpr int kReportRounds = 4, kRenewRounds = 8;

  // The share of one connection. Measured is what happens while all leases are held.
  void Run(JobStore* store, int index) {
    Leases leases(store, blobs_);
    std::vector<Lease> held;
    auto due = SteadyClock::now();
    for (int round = 0; !IsOver(); ++round) {
      std::this_thread::sleep_until(due);
      due = std::max(due, SteadyClock::now() - kRound) + kRound;
      const bool measured = held_ == options_.leases;
      for (size_t i = 0; i < held.size(); ++i) Turn(&leases, held[i], round + static_cast<int>(i));
      int next = index + static_cast<int>(held.size()) * options_.workers;
      for (; next < options_.leases && SteadyClock::now() < due; next += options_.workers) {
        auto lease = Need(leases.Acquire(absl::StrCat("fleet", next)));
        if (!lease) break;
        held.push_back(*std::move(lease));
        if (++held_ == options_.leases) Start();
      }
      const std::chrono::duration<double, std::milli> late = SteadyClock::now() - due;
      const std::lock_guard lock(mutex_);
      if (measured) late_ms_.push_back(std::max(0.0, late.count()));
    }
    for (const Lease& lease : held) leases.GiveBack(lease, 0).IgnoreError();
  }

  void Turn(Leases* leases, const Lease& lease, int turn) {
    const bool renews = turn % kRenewRounds == 0, reports = turn % kReportRounds == 1;
    const absl::Status status =
        renews ? leases->Heartbeat(lease, 0).status() : leases->CancelRequested(lease).status();
    if (absl::IsAborted(status)) ++lost_;
    if (status.ok() && reports) Need(leases->AddProgress(lease, ProgressOf(turn)));
    if (held_ == options_.leases) commits_ += renews + reports;
  }

  void Start() {
    const std::lock_guard lock(mutex_);
    measurement_.emplace(kind_);
    end_ = SteadyClock::now() + std::chrono::duration<double>(options_.seconds);
  }
  bool IsOver() {
    const std::lock_guard lock(mutex_);
    return measurement_ && SteadyClock::now() >= end_;
  }

  const Kind& kind_;
  const BenchOptions& options_;
  BlobStore* const blobs_;
  std::atomic<int> held_{0};
  std::atomic<int64_t> commits_{0}, lost_{0};
  std::mutex mutex_;
  std::optional<Measurement> measurement_;
  std::chrono::time_point<SteadyClock, std::chrono::duration<double>> end_;
  std::vector<double> late_ms_;
};

// From the commit of an event until another process has read it.
void MeasureLatency(const Kind& kind, const BenchOptions& options) {
  const auto writer = kind.open(), reader = kind.open();
  Need(writer
           ->Create(QueuedJob("watched", "client0", -2, writer->NowMs()),
                    [](JobTransaction&) { return absl::OkStatus(); })
           .status());
  std::vector<std::atomic<int64_t>> committed(static_cast<size_t>(options.latencies));
  const auto now_us = [] {
    return std::chrono::duration_cast<std::chrono::microseconds>(
               SteadyClock::now().time_since_epoch())
        .count();
  };
  std::vector<double> latencies_ms;
  std::thread watch([&] {
    int64_t seen = -1, last = 0;
    while (last < options.latencies) {
      const auto events = Need(reader->Events("watched", last, 100));
      for (const EventRecord& event : events) {
        last = event.number;
        const int64_t at = committed[static_cast<size_t>(last - 1)];
        // Read before its writer knew of its commit: no wait at all.
        latencies_ms.push_back(at == 0 ? 0 : 1e-3 * static_cast<double>(now_us() - at));
      }
      if (events.empty()) seen = Need(reader->WaitForChange(ChangeTopic::kJobs, seen, 1));
    }
  });
  for (auto& time : committed) {
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
    Need(writer
             ->Update("watched",
                      [](JobTransaction& job) {
                        return job.AddEvent({0, 1, EventKind::kProgress, "{}"});
                      })
             .status());
    time = now_us();
  }
  watch.join();
  std::sort(latencies_ms.begin(), latencies_ms.end());
  const auto at = [&](double part) {
    return latencies_ms[static_cast<size_t>(part * static_cast<double>(latencies_ms.size() - 1))];
  };
  std::printf("%-9s %-28s p50 %.1f ms, p99 %.1f ms, longest %.1f ms\n", kind.name.c_str(),
              "event seen elsewhere after", at(0.5), at(0.99), latencies_ms.back());
}

int Run(int argc, char** argv) {
  CLI::App app{"Measures job stores under synthetic workers."};
  BenchOptions options;
  std::vector<std::string> stores = {"sqlite", "postgres"};
  app.add_option("STORE", stores, "sqlite and postgres: new ones of this machine's packages");
  app.add_option("--workers", options.workers, "At the same time")->capture_default_str();
  app.add_option("--leases", options.leases,
                 "Held at the same time for --seconds, over the connections of --workers")
      ->capture_default_str();
  app.add_option("--jobs", options.jobs, "Taken and ended")->capture_default_str();
  app.add_option("--waiting", options.waiting, "In the queue behind them")->capture_default_str();
  app.add_option("--clients", options.clients, "To whom the jobs belong")->capture_default_str();
  app.add_option("--reports", options.reports, "Of each job")->capture_default_str();
  app.add_option("--latencies", options.latencies, "Events watched")->capture_default_str();
  app.add_option("--seconds", options.seconds, "Of writing events")->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  std::printf("%d workers, %d leases, %d jobs of %d reports, %d more in the queue, %d clients\n",
              options.workers, options.leases, options.jobs, options.reports, options.waiting,
              options.clients);
  for (const std::string& store : stores) {
    TempDir dir;
    const auto blobs = Need(OpenDiskBlobStore(dir.path()));
    std::unique_ptr<PostgresServer> postgres;
    Kind kind;
    kind.name = store;
    if (store == "sqlite") {
      const std::string path = dir.path() + "/jobs.db";
      kind.open = [path] { return Need(OpenSqliteJobStore(path)); };
      kind.server_cpu = [] { return 0.0; };
    } else {
      postgres = Need(PostgresServer::Start(/*durable=*/true));
      const std::string url = Need(postgres->NewDatabase());
      kind.open = [url] { return Need(OpenPostgresJobStore(url)); };
      kind.server_cpu = [&postgres] { return CpuOf(postgres->pid()); };
    }
    Fill(kind, options);
    MeasureLeases(kind, options, blobs.get());
    MeasureEvents(kind, options, blobs.get());
    if (options.leases > 0) Fleet(kind, options, blobs.get()).Measure();
    MeasureLatency(kind, options);
  }
  return 0;
}

}  // namespace
}  // namespace litags

int main(int argc, char** argv) { return litags::Run(argc, argv); }
