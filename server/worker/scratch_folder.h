#ifndef LITAGS_SERVER_WORKER_SCRATCH_FOLDER_H_
#define LITAGS_SERVER_WORKER_SCRATCH_FOLDER_H_

#include <memory>
#include <string>

#include "absl/status/statusor.h"

namespace litags {

// A folder for one job on one machine, gone with this object. Locked while it lives, so that one
// whose process was killed is told from one in use.
class ScratchFolder {
 public:
  // A new one in `root`. Removes those that killed processes left there. RESOURCE_EXHAUSTED
  // (DISK_FULL), INTERNAL (STORE_FAILED).
  static absl::StatusOr<std::unique_ptr<ScratchFolder>> Make(const std::string& root);
  ~ScratchFolder();
  ScratchFolder(const ScratchFolder&) = delete;
  ScratchFolder& operator=(const ScratchFolder&) = delete;

  // Removes the folders in `root` whose processes are gone.
  static void RemoveAbandoned(const std::string& root);

  const std::string& path() const { return path_; }

 private:
  ScratchFolder(std::string path, int fd) : path_(std::move(path)), fd_(fd) {}

  const std::string path_;
  const int fd_;
};

}  // namespace litags

#endif  // LITAGS_SERVER_WORKER_SCRATCH_FOLDER_H_
