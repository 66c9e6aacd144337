#ifndef LITAGS_SERVER_STORE_DATA_DIR_H_
#define LITAGS_SERVER_STORE_DATA_DIR_H_

#include <memory>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"

namespace litags {

// The folder that holds everything of one installation.
//   litags.db        jobs, files, events; litags.db-reserve: see sqlite_reserve.h
//   blobs/           photos, depth maps, checkpoints, scenes, previews, by digest
//   scratch/         a folder for each job that is running on this machine; see ScratchFolder
//   uploads/JOB/     files that have come in part; gone once the job is started
//   tmp/             exports and unpacked files in flight; emptied when a server starts, swept
//   later
//   missed           jobs that have files and no row, and for how long a server has missed them
struct DataDir {
  std::string root;
  std::string database() const { return root + "/litags.db"; }
  std::string blobs() const { return root + "/blobs"; }
  std::string uploads() const { return root + "/uploads"; }
  std::string tmp() const { return root + "/tmp"; }
  std::string missed() const { return root + "/missed"; }
  std::string scratch() const { return root + "/scratch"; }

  // Makes the folders that are not there, for their owner only; one that is there keeps its
  // permissions. FAILED_PRECONDITION (DATA_DIR_UNUSABLE).
  static absl::StatusOr<DataDir> Open(const std::string& root);
  // Whether the group or everybody may read `root`, write to it or enter it.
  bool OthersMayEnter() const;
  // Removes what killed processes left in tmp/ and blobs/tmp/: what nobody has made or changed for
  // that long; 0: all there is in tmp/, before workers of this server are started. Of blobs that
  // stand elsewhere BlobStore::RemoveTemporary() does, after a day: other machines write there.
  void EmptyTmp(double quiet_seconds) const;
};

// One server per data folder: held while it lives, given up by the kernel if the process dies.
class DataDirLock {
 public:
  // FAILED_PRECONDITION (DATA_DIR_IN_USE) if another process holds it for a second: what a server
  // was starting when it was killed has the lock until it runs a program of its own.
  static absl::StatusOr<std::unique_ptr<DataDirLock>> Take(const DataDir& dir);
  ~DataDirLock();

 private:
  explicit DataDirLock(int fd) : fd_(fd) {}
  const int fd_;
};

}  // namespace litags

#endif  // LITAGS_SERVER_STORE_DATA_DIR_H_
