#include "server/worker/machine.h"

#include <sched.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>

#include "engine/core/machine_memory.h"

namespace litags {
namespace {

int MachineCores() {
  cpu_set_t set;
  return sched_getaffinity(0, sizeof(set), &set) == 0 ? CPU_COUNT(&set) : 0;
}

// "max PERIOD", or "QUOTA PERIOD".
void LowerTo(const std::filesystem::path& file, int* cores) {
  double quota = 0, period = 0;
  if (!(std::ifstream(file) >> quota >> period) || quota <= 0 || period <= 0) return;
  *cores = std::min(*cores, std::max(1, static_cast<int>(std::floor(quota / period))));
}

}  // namespace

Resources FoundResources(const std::string& root) {
  Resources found{MachineCores(), MachineMemory(root), {}};
  for (const std::filesystem::path& group : ControlGroups(root)) {
    LowerTo(group / "cpu.max", &found.cores);
  }
  return found;
}

}  // namespace litags
