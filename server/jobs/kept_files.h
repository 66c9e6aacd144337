// What the engine leaves in its work folder for later runs of a job, as blobs: checkpoint, cameras,
// depth maps, scene. A job's row names them all (JobRecord::kept), so that whoever may change the
// row decides what there is: a worker that lost its lease can store bytes, but nobody will see
// them.
#ifndef LITAGS_SERVER_JOBS_KEPT_FILES_H_
#define LITAGS_SERVER_JOBS_KEPT_FILES_H_

#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "server/store/blob_store.h"

namespace litags {

// The key of what a job names as `blob`: "SHA256" for a file that was uploaded, "N/SHA256" for what
// a lease stored, N the number of the event that began the lease. No two leases store under one
// key, so that what nothing names any more can be removed without asking who else has it.
std::string BlobKey(std::string_view job_id, std::string_view blob);
std::string LeaseBlob(int64_t lease, std::string_view sha256);

struct KeptFile {
  std::string blob;
  int64_t bytes = 0;
  bool operator==(const KeptFile&) const = default;
};
// By path in the work folder: "cameras/images.bin".
using KeptFiles = std::map<std::string, KeptFile>;

inline constexpr char kSceneFile[] = "scene.litags";
// The scene of a job that had succeeded and was resumed: what is kept of it until a better one is
// finished. The one name that is of no file in a work folder.
inline constexpr char kFinishedScene[] = "finished/scene.litags";

// Paths of the files in a work folder that a later run wants: all that lie in it and in its
// folders, but for the workspace of finding cameras, photos and masks that each run picks or makes
// anew, links, marks of the engine's own folders, and files that are being written. INTERNAL
// (STORE_FAILED) if a folder cannot be read: no list rather than half of one, since what is not
// listed is not kept any more.
absl::StatusOr<std::vector<std::string>> FilesWorthKeeping(const std::string& work_folder);

// Stores the file at `path`, which may be replaced meanwhile, but not written to: as it was at one
// moment. `known` if that has the same bytes. `staging` is a path on the same file system that
// nothing uses; a store there takes the file without copying it. NOT_FOUND (FILE_GONE), INTERNAL
// (STORE_FAILED) if it is a link, and the errors of BlobStore::PutFile().
absl::StatusOr<KeptFile> StoreFile(BlobStore* blobs, std::string_view job_id, int64_t lease,
                                   const std::string& path, const std::string& staging,
                                   const KeptFile& known);

}  // namespace litags

#endif  // LITAGS_SERVER_JOBS_KEPT_FILES_H_
