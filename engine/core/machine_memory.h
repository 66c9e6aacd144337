#ifndef LITAGS_ENGINE_CORE_MACHINE_MEMORY_H_
#define LITAGS_ENGINE_CORE_MACHINE_MEMORY_H_

#include <cstdint>
#include <string>

namespace litags {

// What this process may use: what the machine has, or what its control groups (of version 1 or 2)
// leave it, as in a container. `root` is where /proc and /sys are found.

// Bytes of main memory. 0: cannot be found out.
int64_t MachineMemory(const std::string& root = "");

// Whole cores, at least 1.
int MachineCores(const std::string& root = "");

}  // namespace litags

#endif  // LITAGS_ENGINE_CORE_MACHINE_MEMORY_H_
