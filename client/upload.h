// A capture on this machine and its way to the server.
#ifndef LITAGS_CLIENT_UPLOAD_H_
#define LITAGS_CLIENT_UPLOAD_H_

#include <cstdint>
#include <string>
#include <vector>

#include "absl/functional/function_ref.h"
#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "client/client.h"

namespace litags::client {

// A file to send. Only its name, never its folder, goes over the wire.
struct LocalFile {
  std::string path;
  std::string name;  // last component of path
  v1::FileRole role = v1::FILE_ROLE_PHOTO;
  int64_t size_bytes = 0;
  std::string sha256;  // 32 bytes; empty until computed
};

struct Capture {
  std::vector<LocalFile> files;      // by role, then name
  std::vector<std::string> skipped;  // names in the folders that are of no use there
  int64_t bytes = 0;                 // of all files
  std::vector<std::string> notes;    // what the user should know of the choice
  std::string masks_dir;             // where masks come from; empty: there are none
};

// The photos of a folder (not of its subfolders; hidden files do not count) or a ZIP or TAR archive
// of one, or a video, and, where the paths are not empty, cameras (a transforms.json, or the folder
// of a COLMAP model or of several, of which the largest is taken), a folder of depth maps and one
// of masks; without one, the photos' subfolder "masks", if there is one. INVALID_ARGUMENT:
// FOLDER_MISSING, FOLDER_EMPTY, NO_PHOTOS, NO_MASKS, FILE_UNREADABLE.
absl::StatusOr<Capture> ScanCapture(const std::string& photos_dir, const std::string& cameras_path,
                                    const std::string& depth_dir, const std::string& masks_dir);

// SHA-256 of a file, 32 bytes. INVALID_ARGUMENT (FILE_UNREADABLE).
absl::StatusOr<std::string> FileSha256(const std::string& path);

struct UploadProgress {
  int files_done = 0;  // acknowledged by the server
  int files = 0;
  int64_t bytes_done = 0;
  int64_t bytes = 0;
  std::vector<std::string> skipped;   // files in archives that the service has no use for
  std::vector<std::string> left_out;  // why, of each photo that the service cannot read
};

// Sends the files to a job in state UPLOADING and returns when the server has acknowledged all.
// They go in streams of a few megabytes each; before each, and after a broken one, the server is
// asked what it has, so that no byte that arrived is sent again. A photo that the service cannot
// read is left out, and its mask, as long as three remain; with `strict` it is an error.
// INVALID_ARGUMENT
// (FILE_UNREADABLE, FILE_CHANGED) for trouble on this side, else the errors of UploadImages.
absl::Status UploadFiles(Client& client, const std::string& job, std::vector<LocalFile>& files,
                         absl::FunctionRef<void(const UploadProgress&)> on_progress,
                         bool strict = false);

// A digest over roles, names and contents of all files, for CreateJobRequest.content_digest; fills
// in their own digests. INVALID_ARGUMENT (FILE_UNREADABLE).
absl::StatusOr<std::string> ContentDigest(std::vector<LocalFile>& files);

}  // namespace litags::client

#endif  // LITAGS_CLIENT_UPLOAD_H_
