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

// Path of the control group that this process is in: for a controller of version 1 ("memory"), or
// "" for version 2. A container of version 2 sees its own as "/"; one of version 1 is told the
// machine's path to it, and finds it at the top nevertheless.
fs::path OwnGroup(const std::string& root, const std::string& controller) {
  std::ifstream file(root + "/proc/self/cgroup");
  // NUMBER:CONTROLLER,CONTROLLER:/PATH
  for (std::string number, names, path; std::getline(file, number, ':') &&
                                        std::getline(file, names, ':') &&
                                        std::getline(file, path);) {
    const bool is_of = ("," + names + ",").find("," + controller + ",") != std::string::npos;
    if (is_of && path.starts_with('/')) return path.substr(1);
  }
  return "";
}

// Folders of the control groups that this process is in, its own first, each in the one behind it:
// none can have more than those around it. `controller`: as in OwnGroup().
std::vector<fs::path> ControlGroups(const std::string& root, const std::string& controller) {
  const fs::path top = fs::path(root + "/sys/fs/cgroup") / controller;
  std::vector<fs::path> groups;
  for (fs::path group = OwnGroup(root, controller);; group = group.parent_path()) {
    groups.push_back(top / group);
    if (group.empty()) return groups;
  }
}

// The number at the start of a file; 0 if there is none.
int64_t NumberIn(const fs::path& path) {
  int64_t number = 0;
  std::ifstream(path) >> number;
  return number;
}

}  // namespace

int64_t MachineMemory(const std::string& root) {
  int64_t bytes = TotalBytes(root);
  const auto limit = [&](const std::string& controller, const char* file) {
    for (const fs::path& group : ControlGroups(root, controller)) {
      const int64_t most = NumberIn(group / file);  // 0 for "max"
      if (most > 0) bytes = std::min(bytes, most);
    }
  };
  limit("", "memory.max");
  limit("memory", "memory.limit_in_bytes");
  return bytes;
}

int MachineCores(const std::string& root) {
  double cores = AllowedCores();
  const auto limit = [&](double quota, double period) {
    if (quota > 0 && period > 0) cores = std::min(cores, quota / period);
  };
  for (const fs::path& group : ControlGroups(root, "")) {
    double quota = 0, period = 0;  // "max PERIOD", or "QUOTA PERIOD"
    std::ifstream(group / "cpu.max") >> quota >> period;
    limit(quota, period);
  }
  for (const fs::path& group : ControlGroups(root, "cpu")) {
    // A quota of -1: none.
    limit(NumberIn(group / "cpu.cfs_quota_us"), NumberIn(group / "cpu.cfs_period_us"));
  }
  return std::max(1, static_cast<int>(cores));
}

}  // namespace litags
