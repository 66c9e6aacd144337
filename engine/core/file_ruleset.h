// Which files a program that touches strangers' bytes can open (Landlock).
#ifndef LITAGS_ENGINE_CORE_FILE_RULESET_H_
#define LITAGS_ENGINE_CORE_FILE_RULESET_H_

#include <cerrno>
#include <string>
#include <vector>

#include "engine/core/unique_fd.h"

namespace litags {

// Files and folders, each with all in it. Those that are not there are left out.
struct FileAccess {
  std::vector<std::string> read;    // and run
  std::vector<std::string> change;  // and read: files and folders, no links, devices or programs
};

// All other files a process, and all it starts from then on, can no longer open, make, move or
// remove. What is open already stays so. Works without any privilege.
class FileRuleset {
 public:
  explicit FileRuleset(const FileAccess& access);

  // Whether this kernel has such rules: Linux 5.13 or later, unless it or a container forbids them.
  static bool Supported();
  // 0, or errno: ENOSYS without Supported(). Nothing is refused then. Async-signal-safe.
  int Apply() const;

 private:
  UniqueFd ruleset_;
  int error_ = ENOSYS;
};

// What `program` needs to run with `environment`: the system's programs and libraries, what the
// kernel says of the machine, its own folder, the folder lib/ beside it, and LD_LIBRARY_PATH.
FileAccess AccessToRun(const std::string& program, const std::vector<std::string>& environment);

}  // namespace litags

#endif  // LITAGS_ENGINE_CORE_FILE_RULESET_H_
