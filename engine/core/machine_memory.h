#ifndef LITAGS_ENGINE_CORE_MACHINE_MEMORY_H_
#define LITAGS_ENGINE_CORE_MACHINE_MEMORY_H_

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace litags {

// Folders of the control groups (version 2) that this process is in, its own first, each in the one
// behind it: none can have more than those around it. `root` is where /proc and /sys are found.
std::vector<std::filesystem::path> ControlGroups(const std::string& root = "");

// Bytes of main memory that this process may use: those of the machine, or what its control groups
// leave it, as in a container. 0: cannot be found out.
int64_t MachineMemory(const std::string& root = "");

}  // namespace litags

#endif  // LITAGS_ENGINE_CORE_MACHINE_MEMORY_H_
