#include "engine/core/machine_memory.h"

#include <sched.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <thread>
#include <vector>

namespace litags {
namespace {

namespace fs = std::filesystem;

int64_t TotalBytes(const std::string& root) {
  std::ifstream file(root + "/proc/meminfo");
  std::string name, unit;
  for (int64_t kib; file >> name >> kib;) {
    if (name == "MemTotal:") return kib * 1024;
    std::getline(file, unit);
  }
  return 0;
}

// Those of the affinity mask.
int AllowedCores() {
  cpu_set_t cpus;
  if (sched_getaffinity(0, sizeof(cpus), &cpus) == 0) return CPU_COUNT(&cpus);
  return static_cast<int>(std::thread::hardware_concurrency());
}

// Below /sys/fs/cgroup; a container sees its own as "/".
fs::path OwnGroup(const std::string& root) {
  std::ifstream file(root + "/proc/self/cgroup");
  for (std::string line; std::getline(file, line);) {
    if (line.starts_with("0::/")) return line.substr(4);
  }
  return "";
}

// Folders of the control groups that this process is in, its own first, each in the one behind it:
// none can have more than those around it.
std::vector<fs::path> ControlGroups(const std::string& root) {
  const fs::path top = root + "/sys/fs/cgroup";
  std::vector<fs::path> groups;
  for (fs::path group = OwnGroup(root);; group = group.parent_path()) {
    groups.push_back(top / group);
    if (group.empty()) return groups;
  }
}

}  // namespace

int64_t MachineMemory(const std::string& root) {
  int64_t bytes = TotalBytes(root);
  for (const fs::path& group : ControlGroups(root)) {
    int64_t limit = 0;  // "max", or a number
    if (std::ifstream(group / "memory.max") >> limit && limit > 0) bytes = std::min(bytes, limit);
  }
  return bytes;
}

int MachineCores(const std::string& root) {
  double cores = AllowedCores();
  for (const fs::path& group : ControlGroups(root)) {
    double quota = 0, period = 0;  // "max PERIOD", or "QUOTA PERIOD"
    if (std::ifstream(group / "cpu.max") >> quota >> period && quota > 0 && period > 0) {
      cores = std::min(cores, quota / period);
    }
  }
  return std::max(1, static_cast<int>(cores));
}

}  // namespace litags
