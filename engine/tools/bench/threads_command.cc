// litags-bench threads: how an iteration would spread over more cores than this machine has. Every
// task of every loop is timed on one thread; then the loops are dealt out to more threads as
// ParallelFor() deals them. What cores share (memory, cache) and waking threads is not in it.
#include <algorithm>
#include <cstdio>
#include <map>
#include <memory>
#include <numeric>
#include <string>
#include <vector>

#include "CLI/App.hpp"
#include "CLI/Config.hpp"
#include "CLI/Formatter.hpp"
#include "absl/strings/str_cat.h"
#include "engine/core/loop_trace.h"
#include "engine/core/quantile.h"
#include "engine/tools/bench/bench_scene.h"
#include "engine/tools/bench/commands.h"
#include "engine/tools/bench/loop_span.h"
#include "engine/tools/bench/timing_options.h"
#include "engine/train/recipe.h"
#include "engine/train/trainer.h"
#include "proto/arguments/arguments.h"

namespace litags {
namespace {

constexpr int kMostThreads = 64;

double TotalMs(const std::vector<double>& tasks_ms) {
  return std::accumulate(tasks_ms.begin(), tasks_ms.end(), 0.0);
}

double SerialMs(const Trace& trace) {
  double ms = trace.after_ms;
  for (const LoopTrace& loop : trace.loops) ms += loop.before_ms;
  return ms;
}

std::vector<Trace> TraceIterations(const TimingOptions& timing) {
  const Camera camera = BenchCamera(timing.width, timing.height);
  const std::vector<TrainView> views = {BenchView(camera)};
  TrainOptions options;
  options.recipe = Litags();
  options.recipe.densify_until = 0;
  options.recipe.coarse_levels = 0;
  options.recipe.sh_interval = 1;
  options.iterations = 1000000;
  options.threads = kMostThreads;
  Trainer trainer(options, &views, BenchSplats(timing.gaussians, camera), 1.0);
  std::vector<Trace> traces;
  for (int i = -2; i < timing.repetitions; ++i) {  // two to warm up
    Trace trace = TraceLoops([&] { (void)trainer.Step(); });
    if (i >= 0) traces.push_back(std::move(trace));
  }
  return traces;
}

void ReportThreads(const std::vector<Trace>& traces) {
  std::printf("%7s %10s %10s %12s\n", "threads", "ms", "as fast", "idle cores");
  double alone = 0;
  for (int threads = 1; threads <= kMostThreads; threads *= 2) {
    std::vector<double> ms, busy;
    for (const Trace& trace : traces) {
      ms.push_back(SerialMs(trace));
      busy.push_back(ms.back());
      for (const LoopTrace& loop : trace.loops) {
        ms.back() += LoopSpanMs(loop.tasks_ms, threads);
        busy.back() += TotalMs(loop.tasks_ms);
      }
    }
    const double median = Median(ms);
    if (threads == 1) alone = median;
    std::printf("%7d %10.2f %10.2f %11.0f%%\n", threads, median, alone / median,
                100 * (1 - Median(busy) / (median * threads)));
  }
}

// What keeps `threads` threads from being as many times as fast, by loop.
void ReportLoops(const std::vector<Trace>& traces, int threads) {
  struct Row {
    std::vector<double> before, total, lost;
    size_t tasks = 0;
  };
  std::map<std::string, Row> rows;
  for (const Trace& trace : traces) {
    for (size_t i = 0; i < trace.loops.size(); ++i) {
      const LoopTrace& loop = trace.loops[i];
      const std::string file = loop.file;
      Row& row = rows[absl::StrCat(absl::Dec(i, absl::kZeroPad2), " ",
                                   file.substr(file.rfind('/') + 1), ":", loop.line)];
      row.before.push_back(loop.before_ms);
      row.total.push_back(TotalMs(loop.tasks_ms));
      row.lost.push_back(LoopSpanMs(loop.tasks_ms, threads) - row.total.back() / threads);
      row.tasks = loop.tasks_ms.size();
    }
  }
  std::printf("\n%-30s %6s %10s %12s %15s\n", "loop", "tasks", "ms alone", "serial before",
              absl::StrCat("lost on ", threads).c_str());
  for (const auto& [name, row] : rows) {
    std::printf("%-30s %6zu %10.3f %12.3f %15.3f\n", name.c_str(), row.tasks, Median(row.total),
                Median(row.before), Median(row.lost));
  }
}

}  // namespace

void AddThreadsCommand(CLI::App* app) {
  struct Arguments {
    TimingOptions timing;
    int threads = 16;
  };
  auto args = std::make_shared<Arguments>();
  CLI::App* command =
      app->add_subcommand("threads", "Works out how an iteration spreads over more cores");
  AddTimingOptions(command, &args->timing);
  command->add_option("--loops-on", args->threads, "threads of the list of loops")
      ->capture_default_str()
      ->check(Between(1, kMostThreads));
  command->callback([args] {
    const std::vector<Trace> traces = TraceIterations(args->timing);
    ReportThreads(traces);
    ReportLoops(traces, args->threads);
  });
}

}  // namespace litags
