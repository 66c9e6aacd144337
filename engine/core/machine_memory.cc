#include "engine/core/machine_memory.h"

#include <algorithm>
#include <fstream>

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

// Below /sys/fs/cgroup; a container sees its own as "/".
fs::path OwnGroup(const std::string& root) {
  std::ifstream file(root + "/proc/self/cgroup");
  for (std::string line; std::getline(file, line);) {
    if (line.starts_with("0::/")) return line.substr(4);
  }
  return "";
}

}  // namespace

std::vector<fs::path> ControlGroups(const std::string& root) {
  const fs::path top = root + "/sys/fs/cgroup";
  std::vector<fs::path> groups;
  for (fs::path group = OwnGroup(root);; group = group.parent_path()) {
    groups.push_back(top / group);
    if (group.empty()) return groups;
  }
}

int64_t MachineMemory(const std::string& root) {
  int64_t bytes = TotalBytes(root);
  for (const fs::path& group : ControlGroups(root)) {
    int64_t limit = 0;  // "max", or a number
    if (std::ifstream(group / "memory.max") >> limit && limit > 0) bytes = std::min(bytes, limit);
  }
  return bytes;
}

}  // namespace litags
