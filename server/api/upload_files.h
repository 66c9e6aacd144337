// What an uploaded file may be: names and sizes by role.
#ifndef LITAGS_SERVER_API_UPLOAD_FILES_H_
#define LITAGS_SERVER_API_UPLOAD_FILES_H_

#include <cstdint>
#include <optional>
#include <string>

#include "absl/status/status.h"
#include "absl/status/statusor.h"
#include "litags/v1/reconstruction_service.pb.h"
#include "server/archive/extract.h"
#include "server/jobs/uploads.h"

namespace litags {

// A file that is announced or asked for, checked as far as its header goes.
struct UploadHeader {
  FileRecord record;
  std::string field;  // "images[NAME]"
};
// Unspecified: a photo. INVALID_ARGUMENT (FILE_ROLE_UNKNOWN).
absl::StatusOr<FileRole> ParseFileRole(v1::FileRole role, const char* field);
absl::StatusOr<UploadHeader> ParseFileHeader(const v1::FileHeader& header,
                                             const UploadLimits& limits);

// How errors name a file: "images[NAME]", "depths[NAME]", ...
std::string FieldOf(FileRole role, const std::string& name);

// RESOURCE_EXHAUSTED (FILE_TOO_LARGE), for a file by itself and for one in an archive alike: the
// engine refuses larger ones.
absl::Status CheckSize(FileRole role, int64_t bytes, const UploadLimits& limits,
                       const std::string& field);

// One plain component with an extension that the role has. INVALID_ARGUMENT (BAD_FILE_NAME).
absl::Status CheckName(const std::string& name, FileRole role, const std::string& field);

// COLMAP lists all that features saw. So much is read in a second; as text, in 10 s and 1.2 GiB.
inline constexpr int64_t kMaxColmapBytes = int64_t{1} << 30;

// Of any file in an archive; CheckSize() knows which it is.
int64_t MaxEntryBytes(const UploadLimits& limits);

// What a file in an archive is for, by its name and its folders; nullopt: nothing that a job uses.
std::optional<FileRole> RoleInArchive(const ArchiveEntry& entry);

}  // namespace litags

#endif  // LITAGS_SERVER_API_UPLOAD_FILES_H_
