#include "server/worker/machine.h"

#include <sched.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>

namespace litags {
namespace {

namespace fs = std::filesystem;

int64_t MachineBytes(const std::string& root) {
  std::ifstream file(root + "/proc/meminfo");
  std::string name, unit;
  for (int64_t kib; file >> name >> kib;) {
    if (name == "MemTotal:") return kib * 1024;
    std::getline(file, unit);
  }
  return 0;
}

int MachineCores() {
  cpu_set_t set;
  return sched_getaffinity(0, sizeof(set), &set) == 0 ? CPU_COUNT(&set) : 0;
}

// This process's group below /sys/fs/cgroup; a container sees its own as "/".
fs::path Group(const std::string& root) {
  std::ifstream file(root + "/proc/self/cgroup");
  for (std::string line; std::getline(file, line);) {
    if (line.starts_with("0::/")) return line.substr(4);
  }
  return "";
}

// "max", or a number.
void LowerTo(const fs::path& file, int64_t* bytes) {
  int64_t limit = 0;
  if (std::ifstream(file) >> limit && limit > 0) *bytes = std::min(*bytes, limit);
}

// "max PERIOD", or "QUOTA PERIOD".
void LowerTo(const fs::path& file, int* cores) {
  double quota = 0, period = 0;
  if (!(std::ifstream(file) >> quota >> period) || quota <= 0 || period <= 0) return;
  *cores = std::min(*cores, std::max(1, static_cast<int>(std::floor(quota / period))));
}

}  // namespace

Resources FoundResources(const std::string& root) {
  Resources found{MachineCores(), MachineBytes(root), {}};
  const fs::path top = root + "/sys/fs/cgroup";
  // A group cannot have more than those around it.
  for (fs::path group = Group(root);; group = group.parent_path()) {
    LowerTo(top / group / "memory.max", &found.memory_bytes);
    LowerTo(top / group / "cpu.max", &found.cores);
    if (group.empty()) return found;
  }
}

}  // namespace litags
