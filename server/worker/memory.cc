#include "server/worker/memory.h"

#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <string>

namespace litags {
namespace {

namespace fs = std::filesystem;

// Deeper trees are none of ours.
constexpr int kMaxDepth = 8;

int64_t ResidentBytes(const std::string& process, int depth) {
  int64_t total_pages = 0, resident_pages = 0;
  std::ifstream(process + "/statm") >> total_pages >> resident_pages;
  int64_t bytes = resident_pages * sysconf(_SC_PAGESIZE);
  if (depth == kMaxDepth) return bytes;
  std::error_code error;  // processes and threads come and go
  for (fs::directory_iterator it(process + "/task", error), end; !error && it != end;
       it.increment(error)) {
    std::ifstream children(it->path() / "children");
    for (std::string child; children >> child;) {
      bytes += ResidentBytes("/proc/" + child, depth + 1);
    }
  }
  return bytes;
}

}  // namespace

int64_t ResidentBytesWithChildren() { return ResidentBytes("/proc/self", 0); }

}  // namespace litags
