#ifndef LITAGS_SERVER_WORKER_MEMORY_H_
#define LITAGS_SERVER_WORKER_MEMORY_H_

#include <cstdint>

namespace litags {

// Bytes of main memory that this process and all its descendants hold. Pages that they share count
// once for each. 0 where /proc does not say.
int64_t ResidentBytesWithChildren();

}  // namespace litags

#endif  // LITAGS_SERVER_WORKER_MEMORY_H_
