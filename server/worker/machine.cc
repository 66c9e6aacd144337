#include "server/worker/machine.h"

#include "engine/core/machine_memory.h"

namespace litags {

Resources FoundResources(const std::string& root) {
  return {MachineCores(root), MachineMemory(root), {}};
}

}  // namespace litags
