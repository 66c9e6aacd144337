#ifndef LITAGS_SERVER_WORKER_MACHINE_H_
#define LITAGS_SERVER_WORKER_MACHINE_H_

#include <string>

#include "server/jobs/placement.h"

namespace litags {

// Cores and bytes of main memory that this process may use: those of the machine, or what its
// control groups (version 2) leave it, as in a container. `root` is where /proc and /sys are found.
// 0 for memory that cannot be found out.
Resources FoundResources(const std::string& root = "");

}  // namespace litags

#endif  // LITAGS_SERVER_WORKER_MACHINE_H_
