#include "engine/tools/bench/timing.h"

#include <sys/resource.h>

namespace litags {

int64_t PeakRssBytes() {
  rusage usage = {};
  getrusage(RUSAGE_SELF, &usage);
  return int64_t{usage.ru_maxrss} * 1024;
}

}  // namespace litags
