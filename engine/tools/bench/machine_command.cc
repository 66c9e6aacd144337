// litags-bench machine: the peaks that docs/performance.md measures kernels against.
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>

#include "CLI/App.hpp"
#include "CLI/Config.hpp"
#include "CLI/Formatter.hpp"
#include "engine/core/json_text.h"
#include "engine/core/parallel.h"
#include "engine/core/simd_target.h"
#include "engine/tools/bench/command_options.h"
#include "engine/tools/bench/commands.h"
#include "engine/tools/bench/machine.h"

namespace litags {

void AddMachineCommand(CLI::App* app, int* exit_status) {
  auto json_path = std::make_shared<std::string>();
  CLI::App* command =
      app->add_subcommand("machine", "Measures this machine's arithmetic and memory peaks");
  AddJsonOption(command, json_path.get());
  WhenGiven(command, exit_status, [json_path] {
    nlohmann::json json;
    json["target"] = SimdTarget();
    json["cores"] = DefaultThreadCount();
    std::printf("instruction set %s, %d cores\n", SimdTarget(), DefaultThreadCount());
    for (int threads = 1; threads <= DefaultThreadCount(); threads *= 2) {
      const double gflops = PeakGflops(threads), gbytes = TriadGbytes(threads);
      std::printf("%d threads: %.1f GFLOP/s multiply-add, %.1f GB/s triad\n", threads, gflops,
                  gbytes);
      json["threads"].push_back(
          {{"threads", threads}, {"gflops", gflops}, {"gbytes_per_second", gbytes}});
    }
    return WriteJson(*json_path, JsonText(json, 2));
  });
}

}  // namespace litags
