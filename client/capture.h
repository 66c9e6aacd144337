// A capture on this machine: which files there are, and what each is for.
#ifndef LITAGS_CLIENT_CAPTURE_H_
#define LITAGS_CLIENT_CAPTURE_H_

#include <cstdint>
#include <string>
#include <vector>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "absl/strings/string_view.h"
#include "client/interrupt.h"
#include "litags/v1/reconstruction_service.pb.h"

namespace litags::client {

// A file to send. Of its path only the name goes over the wire.
struct LocalFile {
  std::string path;
  std::string name;  // last component of path
  v1::FileRole role = v1::FILE_ROLE_PHOTO;
  std::string tail;                         // bytes that go up after those at path
  int64_t size_bytes = 0;                   // of both
  std::string sha256;                       // 32 bytes; empty until computed
  absl::Status trouble = absl::OkStatus();  // why it cannot be sent
};

struct Capture {
  std::vector<LocalFile> files;      // by role, then name
  std::vector<std::string> skipped;  // names in the folders that are of no use there
  int64_t bytes = 0;                 // of all files
  std::vector<std::string> notes;    // what the user should know of the choice
  std::string masks_dir;             // where masks come from; empty: there are none
};

// The photos of a folder (not of its subfolders; hidden files do not count), of a dataset's folder
// (images/ and what lies beside it, docs/datasets.md), or a ZIP or TAR archive of one, or a video,
// and, where the paths are not empty, cameras (a file, a bundle.out with its list of photos, or the
// folder of a COLMAP model or of several, of which the largest is taken), a folder of depth maps
// and one of masks; without one, the photos' subfolder "masks", if there is one. What cannot be
// sent of the folders of photos, depth maps and masks is among the files, with its trouble.
// INVALID_ARGUMENT: FOLDER_MISSING, FOLDER_EMPTY, NO_PHOTOS, NO_MASKS, NO_DEPTH_MAPS,
// FILE_UNREADABLE, BAD_FILE_NAME.
absl::StatusOr<Capture> ScanCapture(const std::string& photos_dir, const std::string& cameras_path,
                                    const std::string& depth_dir, const std::string& masks_dir);

// The title of a job that the user gives none: the name of its folder, archive or video. Empty
// where the service would refuse it.
std::string DefaultTitle(const std::string& photos_dir);

// SHA-256 of a file and what goes up behind it, 32 bytes. INVALID_ARGUMENT (FILE_UNREADABLE);
// CANCELLED soon after `interrupt` was raised.
absl::StatusOr<std::string> FileSha256(const std::string& path, const Interrupt& interrupt,
                                       absl::string_view tail = "");

}  // namespace litags::client

#endif  // LITAGS_CLIENT_CAPTURE_H_
